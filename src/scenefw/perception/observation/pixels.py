"""The image that settings in pixels are for."""

WIDTH = 640
"""Its width (pixels); in other images, lengths are scaled by their width over this one."""
COARSE_WIDTH = 320
"""Pixels across that are enough to compare objects with what is measured; more cost time alone."""
