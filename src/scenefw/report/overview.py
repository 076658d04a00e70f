"""One picture of a prediction: what the camera saw, and the complete objects from two sides."""

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from scenefw.core.files import replacing
from scenefw.core.types import Camera, Float32, Frame, GridSpec, SceneEstimate
from scenefw.report.palette import Colour
from scenefw.report.shading import Solid, draw, turned
from scenefw.report.solids import solid_of

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

_WIDTH, _HEIGHT = 520, 390  # of drawn pictures (pixels)
_SMALL = (360, 270)
_DPI = 200
_INCHES, _ABOVE, _TITLED = 9.4, 6.8, 0.515  # width, height without the legend, height of the title
_ROW, _COLUMNS = 0.22, 5  # inches of a row of the legend, objects in it
_INK = "#333333"
_TURN_OF_PARTIAL = 70.0
_TURN_BEHIND = 165.0
_SEEN = (0.35, 0.47, 0.6)


def write_overview(
    path: Path,
    estimate: SceneEstimate,
    partial: Float32,
    colours: Sequence[Colour],
    frame: Frame | None = None,
) -> None:
    """Writes a PNG with colour, depth and partial TSDF above, the predicted objects below.

    Args:
        path: the file, replaced as a whole.
        estimate: the predicted scene.
        partial: partial TSDF (X, Y, Z) in metres.
        colours: red, green, blue in [0, 1] of each object, in their order.
        frame: the image as it was read; None takes the estimate's, without its background.
    """
    from matplotlib.backends.backend_agg import FigureCanvasAgg

    figure = _figure(estimate, partial, colours, frame or estimate.frame)
    FigureCanvasAgg(figure)
    with replacing(path) as temporary:
        figure.savefig(temporary, dpi=_DPI, facecolor="white", pil_kwargs={"compress_level": 4})


def window(estimate: SceneEstimate, aspect: float = _WIDTH / _HEIGHT) -> tuple[slice, slice]:
    """Rows and columns of the image that show the predicted objects, with some table around.

    Args:
        estimate: its objects are projected into the camera.
        aspect: width by height.
    """
    camera = estimate.frame.camera
    height, width = camera.height, camera.width
    pixels = _project(vertices(estimate), camera)
    if len(pixels) == 0:
        return slice(0, height), slice(0, width)
    low, high = np.clip(pixels.min(axis=0), 0, None), pixels.max(axis=0)
    high = np.minimum(high, (width - 1, height - 1))
    middle, size = (low + high) / 2, (high - low) * 1.5
    wide = min(max(size[0], size[1] * aspect, 0.4 * width), width, height * aspect)
    tall = wide / aspect
    left = int(np.clip(middle[0] - wide / 2, 0, width - wide))
    top = int(np.clip(middle[1] - tall / 2, 0, height - tall))
    return slice(top, top + round(tall)), slice(left, left + round(wide))


def vertices(estimate: SceneEstimate) -> NDArray[np.float64]:
    """All vertices (N, 3) of the objects, world coordinates."""
    if not estimate.objects:
        return np.zeros((0, 3))
    return np.concatenate([item.mesh.vertices for item in estimate.objects])


def _project(points: NDArray[np.float64], camera: Camera) -> NDArray[np.float64]:
    """Pixels (N, 2) of the points before the camera."""
    pose = camera.T_world_camera
    local = (points - pose[:3, 3]) @ pose[:3, :3]
    local = local[local[:, 2] > 0.05]
    return local[:, :2] / local[:, 2:] * (camera.fx, camera.fy) + (camera.cx, camera.cy)


def _figure(
    estimate: SceneEstimate, partial: Float32, colours: Sequence[Colour], frame: Frame
) -> "Figure":
    from matplotlib.figure import Figure

    rows, columns = window(estimate)
    camera = cropped(estimate.frame.camera, rows, columns)
    points = vertices(estimate)
    table = [colours[i] for i in range(len(estimate.objects))]
    solid = solid_of(estimate, by_label(estimate, table))
    seen = Solid(
        _above_floor(partial, estimate.grid),
        np.ones(partial.shape, dtype=np.int32),
        estimate.grid,
        [_SEEN],
    )

    below = _ROW * (2 + -(-len(estimate.objects) // _COLUMNS))  # the legend and its title
    height = _ABOVE + below
    figure = Figure(figsize=(_INCHES, height))
    grid = figure.add_gridspec(
        2, 6, height_ratios=(2, 3.0), left=0.01, right=0.99,
        top=1 - _TITLED / height, bottom=below / height, wspace=0.04, hspace=0.09,
    )  # fmt: skip
    top = [figure.add_subplot(grid[0, 2 * i : 2 * i + 2]) for i in range(3)]
    bottom = [figure.add_subplot(grid[1, 3 * i : 3 * i + 3]) for i in range(2)]
    _show_colour(top[0], frame, rows, columns)
    _show_depth(top[1], frame.depth[rows, columns], estimate.frame.depth[rows, columns])
    _show(
        top[2],
        draw(seen, turned(camera.resized(*_SMALL), points, _TURN_OF_PARTIAL)),
        "partial TSDF: what was seen, from the side",
    )
    _show(bottom[0], draw(solid, camera), "predicted objects, from the camera")
    _show(bottom[1], draw(solid, turned(camera, points, _TURN_BEHIND)), "from behind")
    _title(figure, estimate)
    _legend(figure, estimate, table)
    return figure


def cropped(camera: Camera, rows: slice, columns: slice) -> Camera:
    """The camera of a window of its image, resampled to the size of drawn pictures.

    Args:
        camera: of the whole image.
        rows: of the window, as `window` gives them.
        columns: of the window.
    """
    part = Camera(
        columns.stop - columns.start,
        rows.stop - rows.start,
        camera.fx,
        camera.fy,
        camera.cx - columns.start,
        camera.cy - rows.start,
        camera.T_world_camera,
    )
    return part.resized(_WIDTH, _HEIGHT)


def by_label(estimate: SceneEstimate, colours: Sequence[Colour]) -> list[Colour]:
    """Colours by instance label - 1; labels without an object are grey."""
    table = [(0.6, 0.6, 0.6)] * max([item.id for item in estimate.objects], default=0)
    for item, colour in zip(estimate.objects, colours, strict=True):
        table[item.id - 1] = colour
    return table


def _above_floor(partial: Float32, grid: GridSpec) -> Float32:
    """The partial TSDF without the floor, which is drawn as a plane."""
    heights = grid.centres()[0, 0, :, 2]
    return np.where(heights < grid.voxel_size / 2, np.float32(grid.truncation), partial)


def _show(axes: "Axes", picture: NDArray[Any], title: str) -> None:
    axes.imshow(picture, interpolation="antialiased")
    _dress(axes, title)


def _show_colour(axes: "Axes", frame: Frame, rows: slice, columns: slice) -> None:
    if frame.colour is None:
        axes.text(0.5, 0.5, "no colour image", ha="center", va="center", color="#888888")
        axes.set(xlim=(0, 1), ylim=(0, 1), aspect=_HEIGHT / _WIDTH)
        _dress(axes, "colour")
        return
    _show(axes, frame.colour[rows, columns], "colour")


def _show_depth(axes: "Axes", depth: Float32, used: Float32) -> None:
    """Measured depth, in the range of the part that was used."""
    from matplotlib import colormaps
    from matplotlib.patheffects import withStroke

    measured = used[used > 0]
    near, far = np.percentile(measured, (1, 99)) if measured.size else (0.0, 1.0)
    palette = colormaps["viridis_r"].with_extremes(bad="#f0f0f0")
    image = axes.imshow(
        np.where(depth > 0, depth, np.nan),
        cmap=palette,
        vmin=near,
        vmax=far,
        interpolation="nearest",
    )
    bar = axes.inset_axes((0.03, 0.04, 0.3, 0.03))
    axes.figure.colorbar(image, cax=bar, orientation="horizontal", ticks=())
    bar.spines[:].set_visible(False)
    for x, text, side in ((0.03, f"{near:.2f}", "left"), (0.33, f"{far:.2f} m", "right")):
        label = axes.text(x, 0.085, text, transform=axes.transAxes, ha=side, fontsize=7)
        label.set(color="white", path_effects=[withStroke(linewidth=1.5, foreground=_INK)])
    _dress(axes, "depth")


def _dress(axes: "Axes", title: str) -> None:
    axes.set_xticks(())
    axes.set_yticks(())
    axes.spines[:].set_visible(False)
    axes.set_title(title, fontsize=9.5, color=_INK, loc="left", pad=4)


def _title(figure: "Figure", estimate: SceneEstimate) -> None:
    count = len(estimate.objects)
    name = estimate.frame.name or "scene"
    text = f"{name}: {count} object{'' if count == 1 else 's'}"
    y = 1 - 0.4 * _TITLED / figure.get_figheight()
    figure.text(0.01, y, text, fontsize=14, color=_INK, weight="bold", va="center")


def _legend(figure: "Figure", estimate: SceneEstimate, colours: Sequence[Colour]) -> None:
    """A chip per object with its number, size and confidence, in rows below a title."""
    if not estimate.objects:
        return
    rows = -(-len(estimate.objects) // _COLUMNS)
    row = _ROW / figure.get_figheight()
    title = "objects: number, size, confidence"
    figure.text(0.01, (rows + 0.8) * row, title, fontsize=9.5, color=_INK, va="center")
    for index, (item, colour) in enumerate(zip(estimate.objects, colours, strict=True)):
        x = 0.012 + index % _COLUMNS * 0.198
        y = (rows - 0.3 - index // _COLUMNS) * row
        size = " x ".join(f"{100 * side:.0f}" for side in item.extents)
        figure.text(x, y, "\u25a0", fontsize=12, color=colour, va="center")
        text = f"{item.id}   {size} cm   {item.confidence:.0%}"
        figure.text(x + 0.018, y, text, fontsize=8, color=_INK, va="center")
