"""Volumes of the first scene of the shipped test split beside mesh distances and torch.

Ours starts from the scene's parameters and makes distance, votes and labels. The mesh libraries get
the scene's mesh with everything they build of it for nothing: only their query of the same voxel
centres is timed, and it yields the distance alone. The formula in torch is the radial one, which is
only near the true distance.
"""

import numpy as np
import torch
from torch import Tensor

from benchmarks.harness import Job, Timed
from scenefw.core.batches import SceneParameters
from scenefw.core.types import GridSpec
from scenefw.data.batches.stacks import StackScenes
from scenefw.representations.volumes import object_occupancy, scene_volumes
from scenefw.shapes.superquadric import Superquadric

GRID = GridSpec()
MESH_RESOLUTION = 64
CLOUD = 100_000


def scene() -> SceneParameters:
    """One stack."""
    return StackScenes(split="test", limit=1).parameters([0], torch.device("cpu"))


def scene_mesh() -> tuple[np.ndarray, np.ndarray]:
    """Vertices (V, 3) in world coordinates and faces (F, 3) of all objects of the scene."""
    p, vertices, faces, count = scene(), [], [], 0
    for i in p.present[0].nonzero().flatten().tolist():
        shape = Superquadric(p.half_axes[0, i].numpy(), p.exponents[0, i].numpy())
        mesh = shape.mesh(MESH_RESOLUTION)
        rotation, position = p.rotations[0, i].double().numpy(), p.positions[0, i].numpy()
        vertices.append(mesh.vertices @ rotation.T + position)
        faces.append(mesh.faces + count)
        count += len(mesh.vertices)
    return np.concatenate(vertices), np.concatenate(faces)


def ours() -> Timed:
    """Distance, votes and labels."""
    p = scene()
    return lambda: scene_volumes(p, GRID)


def ours_per_object() -> Timed:
    """Occupancy of every object."""
    p = scene()
    return lambda: object_occupancy(p, GRID)


def open3d() -> Timed:
    """Exact distance to the mesh."""
    import open3d as o3d

    vertices, faces = scene_mesh()
    caster = o3d.t.geometry.RaycastingScene()
    tensors = o3d.core.Tensor(vertices.astype(np.float32)), o3d.core.Tensor(faces.astype(np.uint32))
    caster.add_triangles(*tensors)
    points = GRID.centres().astype(np.float32)
    return lambda: caster.compute_signed_distance(points).numpy()


def mesh_to_sdf() -> Timed:
    """Distance to points sampled on the mesh, sign by their normals: needs no display."""
    import trimesh
    from mesh_to_sdf import get_surface_point_cloud

    vertices, faces = scene_mesh()
    mesh = trimesh.Trimesh(vertices, faces, process=False)
    cloud = get_surface_point_cloud(mesh, surface_point_method="sample", sample_point_count=CLOUD)
    points = GRID.centres().reshape(-1, 3)
    return lambda: cloud.get_sdf_in_batches(points)


def radial_torch() -> Timed:
    """Eager torch: the distance along the ray from the centre, the votes and the labels."""
    p, centres = scene(), torch.tensor(GRID.centres(), dtype=torch.float32)
    return lambda: radial_volumes(p, centres)


def radial_volumes(p: SceneParameters, centres: Tensor) -> tuple[Tensor, Tensor, Tensor]:
    """TSDF (X, Y, Z), votes (X, Y, Z, 3) and labels (X, Y, Z) of the first scene."""
    distances = []
    for i in range(p.present.shape[1]):
        offset = (centres - p.positions[0, i]) @ p.rotations[0, i]
        logs = (offset.abs() / p.half_axes[0, i]).clamp(min=1e-9).log()
        scale = -logs.amax(-1)
        for _ in range(4):  # Newton's method for the scale that brings the point to the surface
            powers = (p.exponents[0, i] * (logs + scale[..., None])).exp()
            total = powers.sum(-1)
            scale = scale - total.log() * total / (p.exponents[0, i] * powers).sum(-1)
        distance = offset.norm(dim=-1) * (1 - scale.exp())
        distances.append(torch.where(p.present[0, i], distance, torch.inf))
    nearest, which = torch.stack(distances).min(dim=0)
    inside = nearest < 0
    away = p.positions[0][which] - centres
    votes = away / away.norm(dim=-1, keepdim=True) * inside[..., None]
    return nearest.clamp(-GRID.truncation, GRID.truncation), votes, (which + 1) * inside


def occupancy_torch() -> Timed:
    """Eager torch: the left side of eq. 5.1."""
    p, centres = scene(), torch.tensor(GRID.centres(), dtype=torch.float32)

    def compute() -> Tensor:
        inside = []
        for i in range(p.present.shape[1]):
            offset = (centres - p.positions[0, i]) @ p.rotations[0, i]
            ratio = offset.abs() / p.half_axes[0, i]
            inside.append(((ratio ** p.exponents[0, i]).sum(-1) < 1) & p.present[0, i])
        return torch.stack(inside)

    return compute


JOBS = [
    Job(
        "scene TSDF, votes and labels, 64^3",
        ours,
        {
            "open3d signed distance (query)": open3d,
            f"mesh-to-sdf, {CLOUD // 1000}k points (query)": mesh_to_sdf,
            "torch, radial formula": radial_torch,
        },
    ),
    Job("occupancy per object, 64^3", ours_per_object, {"torch, eq. 5.1": occupancy_torch}),
]
