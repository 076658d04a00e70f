"""What codes look like: object codes beside empty ones, where they lie, what they group by."""

from typing import Any

import numpy as np
from matplotlib import rc_context
from matplotlib.figure import Figure
from numpy.typing import NDArray
from sklearn.manifold import TSNE

from scenefw.evaluation.sets.results import DecompositionResult, SceneCodes
from scenefw.report.blocks import Drawing
from scenefw.report.figures import COLOURS, INK, STYLE, to_svg

_LINES = 10  # codes of each kind in a figure of lines
_TAKEN, _EMPTY = COLOURS[1], COLOURS[0]

Array = NDArray[np.floating]


def code_blocks(result: DecompositionResult) -> tuple[Drawing, ...]:
    """Figures 6.8 and 6.9 of the thesis, and maps of codes; nothing without codes."""
    codes = [scene.codes for scene in result.scenes if scene.codes is not None]
    if not codes:
        return ()
    values = Drawing(
        values_figure(codes),
        "Left: values of codes that objects come of (orange) and of cells that were not taken "
        "(blue). Right: their channel means, by which cells are taken (thesis fig. 6.8).",
    )
    where = Drawing(
        cells_figure(codes),
        "How often an object's code comes from each cell, by height: the same few cells in all "
        "scenes, or those where objects are (thesis fig. 6.9).",
    )
    groups = Drawing(
        maps_figure(codes),
        "Codes of objects. Left: their two principal components. Right: t-SNE, where neighbours "
        "have like codes and distances between groups mean nothing. Colours are the cells they "
        "come from.",
    )
    return values, where, groups


def values_figure(codes: list[SceneCodes]) -> str:
    """Values of object and empty codes, and their means (SVG)."""
    object_codes = np.concatenate(
        [scene.features[:, scene.cells[scene.exists]].T for scene in codes]
    )
    empty_codes = np.concatenate(
        [np.delete(scene.features, scene.cells, axis=1).T for scene in codes]
    )
    with rc_context(STYLE):
        figure = Figure(figsize=(9.0, 3.0), layout="constrained")
        lines = figure.add_subplot(1, 2, 1, xlabel="channel", ylabel="value")
        means = figure.add_subplot(1, 2, 2, xlabel="channel mean", ylabel="cells (share)")
        edges = _edges(np.concatenate([object_codes.mean(axis=1), empty_codes.mean(axis=1)]))
        for rows, colour in ((empty_codes, _EMPTY), (object_codes, _TAKEN)):
            if len(rows):
                _lines(lines, rows[:: max(len(rows) // _LINES, 1)][:_LINES], colour)
                weights = np.full(len(rows), 1 / len(rows))
                means.hist(
                    rows.mean(axis=1), bins=edges.tolist(), weights=weights, color=colour, alpha=0.6
                )
        return to_svg(figure)


def cells_figure(codes: list[SceneCodes]) -> str:
    """Share of scenes in which a cell holds an object, a panel per layer of cells (SVG)."""
    cells = codes[0].features.shape[1]
    side = round(cells ** (1 / 3))
    counts = np.zeros(cells)
    for scene in codes:
        counts[scene.cells[scene.exists]] += 1
    shares = counts.reshape((side,) * 3) / len(codes)
    with rc_context(STYLE):
        figure = Figure(figsize=(2.2 * side, 2.4), layout="constrained")
        image: Any = None
        for z in range(side):
            axes = figure.add_subplot(1, side, z + 1, title=f"layer {z + 1}", xticks=[], yticks=[])
            layer = shares[:, :, z].T
            image = axes.imshow(layer, vmin=0, vmax=1, cmap="viridis", origin="lower")
        figure.colorbar(image, ax=figure.axes, label="scenes (share)")
        return to_svg(figure)


def maps_figure(codes: list[SceneCodes]) -> str:
    """Codes of objects in the plane: principal components and t-SNE, a colour per cell (SVG)."""
    rows = np.concatenate([scene.codes[scene.exists] for scene in codes])
    cells = np.concatenate([scene.cells[scene.exists] for scene in codes])
    _, kinds = np.unique(cells, return_inverse=True)
    with rc_context({**STYLE, "path.simplify": False}):
        figure = Figure(figsize=(9.0, 3.5), layout="constrained")
        for number, (name, points) in enumerate(
            (("component", principal_components(rows)), ("t-SNE", neighbour_map(rows)))
        ):
            axes = figure.add_subplot(1, 2, number + 1, xlabel=f"{name} 1", ylabel=f"{name} 2")
            axes.grid(alpha=0.15, color=INK)
            for i, colour in enumerate(COLOURS):
                _dots(axes, points[kinds % len(COLOURS) == i], colour)
        return to_svg(figure)


def neighbour_map(rows: Array) -> Array:
    """Places (N, 2) of rows (N, C) by t-SNE (van der Maaten and Hinton 2008).

    The same rows give the same places. Perplexity is 30, less for few rows. Four rows or fewer, or
    equal ones, lie at 0.
    """
    if len(rows) < 5 or np.ptp(rows, axis=0).max() == 0:
        return np.zeros((len(rows), 2))
    perplexity = min(30.0, (len(rows) - 1) / 3)
    # Exact: the quad tree of the approximation overflows the stack where many rows are equal
    embedding: Array = TSNE(
        perplexity=perplexity, init="pca", random_state=0, method="exact"
    ).fit_transform(rows.astype(np.float64))
    return embedding


def principal_components(rows: Array, count: int = 2) -> Array:
    """Coordinates (N, count) of rows (N, C) along the directions of largest variance; 0 beyond."""
    coordinates = np.zeros((len(rows), count))
    if len(rows):
        centred = rows - rows.mean(axis=0)
        left_vectors, sizes, _ = np.linalg.svd(centred.astype(np.float64), full_matrices=False)
        components = min(count, len(sizes))
        coordinates[:, :components] = left_vectors[:, :components] * sizes[:components]
    return coordinates


def _lines(axes: Any, rows: Array, colour: str) -> None:
    axes.plot(rows.T, color=colour, linewidth=0.6, alpha=0.6)


def _dots(axes: Any, points: Array, colour: str) -> None:
    """One line with a piece of no length at each point: far fewer bytes than marks."""
    pieces = np.stack([points, points, np.full_like(points, np.nan)], axis=1).reshape(-1, 2)
    axes.plot(*pieces.T, color=colour, linewidth=4, solid_capstyle="round")


def _edges(values: Array) -> Array:
    low, high = float(values.min()), float(values.max())
    return np.linspace(low, max(high, low + 1e-6), 31)
