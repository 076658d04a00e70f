"""A picture of a point cloud: its colours, labels and normals."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from scenefw.core.files import replacing
from scenefw.core.geometry import inverse, transform_points
from scenefw.core.types import Camera
from scenefw_point_cloud.cloud import PointCloud, palette

_SHOWN = 20_000  # more points make the file slower to draw, not clearer


def draw(cloud: PointCloud, camera: Camera, target: Path | str, title: str = "") -> None:
    """Writes a PNG of the cloud as seen from above the camera: colours, labels, normals."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    rows = np.linspace(0, len(cloud) - 1, min(len(cloud), _SHOWN)).astype(int)
    x, y, z = transform_points(inverse(camera.T_world_camera), cloud.points[rows]).T
    panels = {
        "colours": cloud.colours[rows] / 255,
        "labels": palette(cloud.labels[rows]) / 255,
        "normals": (cloud.normals[rows] + 1) / 2,
    }
    figure = Figure(figsize=(18, 6), layout="constrained")
    FigureCanvasAgg(figure)
    figure.suptitle(f"{title}: {len(cloud)} points")
    for column, (name, colours) in enumerate(panels.items(), start=1):
        axes = figure.add_subplot(1, 3, column, projection="3d")
        axes.scatter(x, z, -y, c=colours, s=1.5, linewidths=0)
        axes.set(title=name, xlabel="right (m)", ylabel="depth (m)", zlabel="up (m)")
        axes.set_aspect("equal")
        axes.view_init(elev=25, azim=-75)
    with replacing(target) as temporary:
        figure.savefig(temporary, dpi=100)
