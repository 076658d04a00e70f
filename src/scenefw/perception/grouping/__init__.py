"""Which segments are one object."""
