"""What objects look like where nothing is visible."""
