"""Models of things on desks."""
