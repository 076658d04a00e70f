"""Table-top scenes, their views and maps."""
