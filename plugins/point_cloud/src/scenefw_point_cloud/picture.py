"""A picture of a point cloud: coloured by label, and by normal."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from scenefw.core.files import replacing
from scenefw_point_cloud.cloud import PointCloud, palette

_SHOWN = 20_000  # more points make the file slower to draw, not clearer


def draw(cloud: PointCloud, target: Path | str, title: str = "") -> None:
    """Writes a PNG with two views of the cloud: labels at the left, normals at the right."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    chosen = np.linspace(0, len(cloud) - 1, min(len(cloud), _SHOWN)).astype(int)
    points = cloud.points[chosen]
    figure = Figure(figsize=(12, 6), layout="constrained")
    FigureCanvasAgg(figure)
    figure.suptitle(f"{title}  {len(cloud)} points")
    colourings = {
        "labels": palette(cloud.labels[chosen]) / 255,
        "normals": (cloud.normals[chosen] + 1) / 2,
    }
    for column, (name, colours) in enumerate(colourings.items(), start=1):
        axes = figure.add_subplot(1, 2, column, projection="3d")
        axes.scatter(*points.T, c=colours, s=1.5, linewidths=0)
        axes.set(title=name, xlabel="x (m)", ylabel="y (m)", zlabel="z (m)")
        axes.set_aspect("equal")
        axes.view_init(elev=35, azim=-60)
    with replacing(target) as temporary:
        figure.savefig(temporary, dpi=110)
