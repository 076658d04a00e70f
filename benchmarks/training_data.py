"""The data side of a training step, from indices of scenes to the network's input and truth.

On CUDA where there is a device, with 64 scenes a step, else on the CPU with 8. The first peer is
the step's other part, forward and backward through the network in bfloat16: `ratio` is how many
times as long that takes (10 or more: the data side is less than a tenth of it). The second peer
does the data side's volumes and partial TSDF alone, in eager torch, with the radial formula, which
is only near the true distance. Before timing on CUDA, a call is made in which any wait for the
device is an error.
"""

from collections.abc import Callable

import torch
from torch import Tensor

from benchmarks.harness import Job, Timed
from benchmarks.volumes import radial_volumes
from scenefw.core.batches import SceneParameters, ShapeInstanceBatch
from scenefw.core.protocols import Representation
from scenefw.core.rng import Streams
from scenefw.core.types import GridSpec
from scenefw.data.batches.augmentation import RigidAugmentation
from scenefw.data.batches.conditioning import shape_instance_batch
from scenefw.data.batches.stacks import StackScenes
from scenefw.data.batches.views import ViewMaker
from scenefw.losses.partial_tsdf import PartialTsdfLoss
from scenefw.losses.sample_spread import SampleSpread
from scenefw.losses.tsdf import TsdfLoss
from scenefw.losses.votes import VoteLoss
from scenefw.mapping.projective import Projective
from scenefw.models.shape_instance_vae import ShapeInstanceVAE
from scenefw.noise.kinect import Kinect
from scenefw.renderers.sphere_tracer import SphereTracer
from scenefw.representations.tsdf import TSDF
from scenefw.representations.vote_field import VoteField
from scenefw.scenes.cameras import RandomViewpoints

GRID = GridSpec()
SIZE = (160, 120)
VOLUMES: dict[str, Representation] = {"tsdf": TSDF(), "votes": VoteField()}
DEVICE = "cuda" if torch.cuda.is_available() else "cpu"
SCENES = 64 if DEVICE == "cuda" else 8


def finished(work: Callable[[], object]) -> Timed:
    """The work, waited for."""

    def run() -> None:
        work()
        if DEVICE == "cuda":
            torch.cuda.synchronize()

    return run


def views(*, noise: bool, grid: GridSpec = GRID) -> ViewMaker:
    """As `experiment=simstack_shipped` makes them, but for noise on all images or none."""
    noises = {"kinect": Kinect(disparity_step=0.031, lateral=0.3)} if noise else {}
    return ViewMaker(
        grid, RandomViewpoints(*SIZE), SphereTracer(), Projective(), noises, RigidAugmentation()
    )


def data_side(
    *, noise: bool, grid: GridSpec = GRID, device: str = DEVICE, scenes: int = SCENES
) -> Callable[[], ShapeInstanceBatch]:
    """Draws the same batch of the shipped stacks at every call."""
    stacks, indices = StackScenes(limit=scenes), torch.arange(scenes)
    maker = views(noise=noise, grid=grid)

    @torch.no_grad()
    def draw() -> ShapeInstanceBatch:
        streams = Streams.of(0, 2, indices=indices.numpy())
        made = maker.make(stacks.parameters(indices, device), streams)
        return shape_instance_batch(made.partial, made.scenes, VOLUMES)

    draw()  # compiled, scenes on the device
    if device == "cuda":
        torch.cuda.set_sync_debug_mode("error")
        draw()
        torch.cuda.set_sync_debug_mode("default")
    return draw


def ours() -> Timed:
    """Without noise."""
    return finished(data_side(noise=False))


def ours_with_noise() -> Timed:
    """With a depth camera's noise."""
    return finished(data_side(noise=True))


def default_network() -> ShapeInstanceVAE:
    """The network of `model=shape_instance_vae`."""
    return ShapeInstanceVAE(GRID.resolution, code_width=8, zero_share=0.1, prior_share=0.9)


def network() -> Timed:
    """Forward and backward of the default network and losses on such a batch."""
    batch, model = data_side(noise=False)(), default_network().to(DEVICE)
    model.to(memory_format=torch.channels_last_3d)
    losses = (TsdfLoss(), VoteLoss(), PartialTsdfLoss(), SampleSpread())

    def step() -> None:
        with torch.autocast(DEVICE, torch.bfloat16):
            prediction = model(batch, torch.Generator())
            total = sum(loss.weight * loss(prediction, batch) for loss in losses)
        total.backward()
        model.zero_grad()

    return finished(step)


def eager() -> Timed:
    """Volumes scene by scene, and voxels looked up in depth images."""
    scenes, maker = StackScenes(limit=SCENES), views(noise=False)
    parameters = scenes.parameters(torch.arange(SCENES), DEVICE)
    with torch.no_grad():
        made = maker.make(parameters, Streams.of(0, 2, indices=range(SCENES)))
    centres = torch.tensor(GRID.centres(), dtype=torch.float32, device=DEVICE)

    @torch.no_grad()
    def compute() -> None:
        for i in range(SCENES):
            radial_volumes(_one(parameters, i), centres)
            intrinsics, pose = made.cameras.intrinsics[i], made.cameras.T_world_camera[i]
            look_up(made.depth[i], intrinsics, pose, centres)

    return finished(compute)


def look_up(depth: Tensor, intrinsics: Tensor, pose: Tensor, centres: Tensor) -> Tensor:
    """Along-ray distance (X, Y, Z) of voxel centres to the depth image (H, W)."""
    x, y, z = ((centres - pose[:3, 3]) @ pose[:3, :3]).unbind(-1)
    fx, fy, cx, cy = intrinsics
    u, v = (fx * x / z + cx).round(), (fy * y / z + cy).round()
    height, width = depth.shape
    seen = (z > 0) & (u >= 0) & (v >= 0) & (u < width) & (v < height)
    at = torch.where(seen, v * width + u, 0.0).long()
    surface = depth.view(-1)[at]
    distance = (surface - z) * (1 + (x / z) ** 2 + (y / z) ** 2).sqrt()
    known = seen & (surface > 0) & (distance > -GRID.truncation)
    return torch.where(known, distance.clamp(max=GRID.truncation), GRID.truncation)


def _one(p: SceneParameters, i: int) -> SceneParameters:
    fields = (p.half_axes, p.exponents, p.rotations, p.positions, p.present)
    return SceneParameters(*[field[i : i + 1] for field in fields])


_WHAT = f"data of a step, {SCENES} scenes, 64^3, {SIZE[0]} x {SIZE[1]}, {DEVICE}"
_STEP = "forward and backward of the network"
JOBS = [
    Job(
        _WHAT,
        ours,
        {_STEP: network, "torch, radial formula and projection alone": eager},
        seconds=20,
    ),
    Job(f"{_WHAT}, noise", ours_with_noise, seconds=20),
]
