"""From volumes to objects: Hough voting, surfaces, Chamfer distances."""

import numpy as np
import torch
from torch import Tensor

from benchmarks.harness import Job, Timed
from scenefw.core.types import GridSpec
from scenefw.metrics.sampling import sample_surface
from scenefw.metrics.surface import chamfer
from scenefw.postprocessing.hough_voting import HoughVoting
from scenefw.postprocessing.surfaces import instance_meshes, surface

GRID = GridSpec()
CENTRES = np.array([[0, 0, 0.05], [-0.06, 0, 0.17], [0.09, 0.02, 0.14], [0.21, 0, 0.15]])
HALVES = np.array([[0.15, 0.1, 0.05], [0.07, 0.07, 0.07], [0.05, 0.05, 0.04], [0.06, 0.08, 0.15]])


def stack() -> tuple[Tensor, Tensor, Tensor]:
    """TSDF, centre votes and labels of four boxes that touch."""
    points = GRID.centres()
    apart = np.abs(points[None] - CENTRES[:, None, None, None]) - HALVES[:, None, None, None]
    fields = np.linalg.norm(np.maximum(apart, 0), axis=-1) + np.minimum(apart.max(axis=-1), 0)
    tsdf = fields.min(axis=0).clip(-GRID.truncation, GRID.truncation)
    labels = np.where(tsdf < 0, fields.argmin(axis=0) + 1, 0).astype(np.int32)
    towards = CENTRES[np.maximum(labels, 1) - 1] - points
    votes = towards / np.maximum(np.linalg.norm(towards, axis=-1, keepdims=True), 1e-9)
    votes = np.moveaxis(np.where((labels > 0)[..., None], votes, 0), -1, 0)
    return (
        torch.tensor(tsdf, dtype=torch.float32),
        torch.tensor(votes.copy(), dtype=torch.float32),
        torch.from_numpy(labels),
    )


def hough_voting() -> Timed:
    """Ours."""
    tsdf, votes, _ = stack()
    method = HoughVoting()
    return lambda: method.extract(tsdf, votes, GRID)


def dense_histogram() -> Timed:
    """Torch: points along all rays into a dense 640^3 histogram, scikit-learn's mean shift."""
    from sklearn.cluster import MeanShift

    tsdf, votes, _ = stack()

    def run() -> Tensor:
        starts = (tsdf < 0).nonzero()
        directions = votes[:, tsdf < 0].T
        counts = torch.zeros(640**3, dtype=torch.int32)
        inside = torch.ones(len(starts), dtype=torch.bool)
        for step in range(400):
            points = starts + 0.5 + 0.1 * step * directions
            voxel = points.long().clamp(0, 63)
            inside &= tsdf[voxel[:, 0], voxel[:, 1], voxel[:, 2]] < 0
            cells = (points[inside] * 10).long().clamp(0, 639)
            keys = (cells[:, 0] * 640 + cells[:, 1]) * 640 + cells[:, 2]
            counts.index_add_(0, keys, torch.ones(len(keys), dtype=torch.int32))
        kept = (counts > 10).nonzero()[:, 0]
        cells = torch.stack([kept // 640**2, kept // 640 % 640, kept % 640], dim=1) / 10
        shift = MeanShift(bandwidth=1.5, bin_seeding=True).fit(cells.numpy())
        centres = torch.from_numpy(shift.cluster_centers_).float()
        to_centre = centres[None] - starts[:, None] - 0.5
        distance = to_centre.norm(dim=2)
        cosine = (to_centre * directions[:, None]).sum(dim=2) / distance
        return (torch.acos(cosine.clamp(-1, 1)) + 0.1 * distance).argmin(dim=1)

    return run


def scene_surface() -> Timed:
    """Ours."""
    tsdf = stack()[0]
    return lambda: surface(tsdf, GRID)


def plain_marching_cubes() -> Timed:
    """scikit-image over the whole grid."""
    from skimage.measure import marching_cubes

    tsdf = stack()[0].numpy()
    return lambda: marching_cubes(tsdf, 0.0)


def cut_meshes() -> Timed:
    """Ours."""
    tsdf, _, labels = stack()
    return lambda: instance_meshes(tsdf, labels, GRID)


def masked_marching_cubes() -> Timed:
    """scikit-image on the whole grid once per instance, other instances set to outside."""
    from skimage.measure import marching_cubes

    tsdf, _, labels = (volume.numpy() for volume in stack())

    def run() -> list[object]:
        return [
            marching_cubes(np.where((labels == i) | (labels == 0), tsdf, 0.01), 0.0)
            for i in range(1, int(labels.max()) + 1)
        ]

    return run


def _clouds(count: int) -> list[np.ndarray]:
    mesh = surface(stack()[0], GRID)
    assert mesh is not None
    return [sample_surface(mesh, count, np.random.default_rng(i)).points for i in range(2)]


def chamfer_dense() -> Timed:
    """Ours."""
    first, second = _clouds(30_000)
    return lambda: chamfer(first, second)


def chamfer_open3d() -> Timed:
    """Open3D: distances between point clouds, both ways."""
    import open3d as o3d

    clouds = [o3d.geometry.PointCloud(o3d.utility.Vector3dVector(c)) for c in _clouds(30_000)]

    def run() -> float:
        forth = np.asarray(clouds[0].compute_point_cloud_distance(clouds[1]))
        back = np.asarray(clouds[1].compute_point_cloud_distance(clouds[0]))
        return float(forth.mean() + back.mean())

    return run


JOBS = [
    Job(
        "3D Hough voting, 4 objects, 64^3",
        hough_voting,
        {"torch dense 640^3 histogram + scikit-learn mean shift": dense_histogram},
    ),
    Job(
        "surface of a 64^3 TSDF", scene_surface, {"scikit-image, whole grid": plain_marching_cubes}
    ),
    Job(
        "watertight mesh of each of 4 instances, 64^3",
        cut_meshes,
        {"scikit-image, whole grid per instance": masked_marching_cubes},
    ),
    Job("Chamfer distance of 2 x 30 000 points", chamfer_dense, {"open3d": chamfer_open3d}),
]
