"""The image that settings in pixels are for."""

WIDTH = 640
"""Its width (pixels); in other images, lengths are scaled by their width over this one."""
BLUR = 3
"""Pixels to each side within which depth and colour may be of something else."""
REACH = 20
"""Pixels to each side of an object's edge that say something about it: ramps are narrower."""
_MIN_AREA = 300  # pixels: noise of real images has up to 184 in one place
_COARSE_WIDTH = 320  # pixels: what many of them say together, a thinned image says as well


def scaled(pixels: float, width: int) -> int:
    """Pixels of an image of some width, 1 or more, that are as long as `pixels` of one 640 wide."""
    return max(1, round(pixels * width / WIDTH))


def coarse_step(width: int) -> int:
    """Every so many-th pixel of an image of some width is enough to ask many of them together."""
    return max(1, width // _COARSE_WIDTH)


def min_area(width: int) -> float:
    """Pixels of an image of some width that say something together: noise has fewer in a place."""
    return _MIN_AREA * (width / WIDTH) ** 2
