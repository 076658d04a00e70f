"""Whether edges of a colour image lie where its depth jumps."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from scipy.fft import irfft2, next_fast_len, rfft2
from scipy.ndimage import gaussian_filter

from scenefw.perception.observation.components import EDGE, neighbours
from scenefw.perception.observation.pixels import BLUR, REACH, coarse_step, min_area
from scenefw.perception.observation.points import STRAYS

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from scenefw.core.types import Float32


class ColourShift(NamedTuple):
    """By how much edges of colour lie beside jumps of depth.

    Attributes:
        rows, columns: pixels from the depth to the colour where they agree best.
        agreement: of images as they are, 1 = as at the best shift, 0 = as at any.
    """

    rows: int
    columns: int
    agreement: float


def colour_shift(depth: Float32, colour: NDArray[np.uint8]) -> ColourShift | None:
    """The shift of an image (H, W, 3) beside its depth (H, W) in metres; None if nothing tells.

    Gradients of brightness are summed over pixels beside which depth jumps away, for all shifts of
    up to a sixteenth of the width, which is a cross-correlation of both images.
    """
    step = coarse_step(depth.shape[1])
    edges = _before_jumps(depth[::step, ::step])
    if np.count_nonzero(edges) < min_area(edges.shape[1]):
        return None
    grey = colour.mean(axis=-1, dtype=np.float32)
    brightness = gaussian_filter(grey, step / 2)[::step, ::step]
    slopes = [gaussian_filter(brightness, 0.7, order=order) for order in ((0, 1), (1, 0))]
    gradient = np.hypot(*slopes)
    gradient = np.minimum(gradient, np.quantile(gradient, 1 - STRAYS))
    if min(edges.shape) <= REACH:
        return None
    padded = [next_fast_len(side + REACH, real=True) for side in edges.shape]
    edge_spectrum = rfft2(edges.astype(np.float32), padded)
    spectrum = rfft2(gradient - gradient.mean(), padded) * edge_spectrum.conj()
    shifts = np.r_[-REACH : REACH + 1]
    sums = irfft2(spectrum, padded)[np.ix_(shifts, shifts)]
    aligned_window = slice(REACH - BLUR, REACH + BLUR + 1)
    peak, mean = float(sums.max()), float(sums.mean())
    if not peak > mean:  # of one colour
        return None
    rows, columns = np.array(np.unravel_index(sums.argmax(), sums.shape)) - REACH
    agreement = (float(sums[aligned_window, aligned_window].max()) - mean) / (peak - mean)
    return ColourShift(int(rows) * step, int(columns) * step, agreement)


def _before_jumps(depth: Float32) -> NDArray[np.bool_]:
    """Pixels (H, W) one of whose four neighbours is farther away; none at borders of the image."""
    edges = np.zeros(depth.shape, dtype=bool)
    valid_depth = np.where(depth > 0, depth, np.nan)
    limit = EDGE * np.maximum(valid_depth, 1.0) ** 2  # as noise grows
    for a, b in neighbours():
        for near, far in ((a, b), (b, a)):
            edges[near] |= valid_depth[far] - valid_depth[near] > limit[near]
    edges[:2] = edges[-2:] = edges[:, :2] = edges[:, -2:] = False
    return edges
