"""What a view says about one object."""
