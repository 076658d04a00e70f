"""The image that settings in pixels are for."""

WIDTH = 640
"""Its width (pixels); in other images, lengths are scaled by their width over this one."""
