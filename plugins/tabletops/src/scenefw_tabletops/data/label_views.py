"""Views of scenes as samples for labelling networks: stored ones, or new ones of every epoch."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, Protocol

import numpy as np
import torch
from numpy.typing import NDArray
from rich.progress import track
from torch import Tensor

from scenefw.core.batches import CameraBatch, SegmentationBatch
from scenefw.core.errors import ConfigError
from scenefw.core.labelling_protocols import FrameSource
from scenefw.core.protocols import Noise, PoseNoise
from scenefw.core.rng import Streams
from scenefw.core.settings import COUNT
from scenefw.core.types import Float64, Frame
from scenefw.kernels.cameras import stack_cameras
from scenefw.kernels.transfer import to_device
from scenefw.labelling.network_inputs import HEIGHT, distance_images, image_tensors
from scenefw.noise.frames import described
from scenefw.renderers.mesh_raycaster import image
from scenefw.renderers.tables import Pictures, camera_lenses
from scenefw_tabletops.data.light import ColourJitter
from scenefw_tabletops.data.resident import ResidentScenes
from scenefw_tabletops.data.table_scenes import TabletopScenes

_VIEW, _CAMERA = 5, 9  # random streams
_NEVER = -1
_ARRAYS = ("colour", "depth", "labels")  # of stored views


@dataclass(frozen=True)
class LabelledViews:
    """B views on a device, as rendered.

    Args:
        colour: (B, 3, H, W) float32 in [0, 1].
        depth: (B, H, W) float32 z-depth (m), 0 = none.
        labels: (B, H, W) int8 class ids, -1 = unknown.
        cameras: of the views.
    """

    colour: Tensor
    depth: Tensor
    labels: Tensor
    cameras: CameraBatch


class ViewImages(Protocol):
    """Numbered views: view number index % views of scene index // views."""

    @property
    def source(self) -> FrameSource:
        """Whose views they are."""

    @property
    def classes(self) -> Sequence[str]:
        """Names by class id."""

    def __len__(self) -> int:
        """Views of all scenes."""

    def prepare(self, device: torch.device) -> None:
        """Does once what all batches need."""

    def render(
        self, indices: NDArray[np.int64], epoch: int | None, device: torch.device
    ) -> LabelledViews:
        """The views of these indices as a training sees them in an epoch.

        With `epoch=None`, as in validation, they are the same views whenever they are asked for.
        """


class ViewSamples:
    """Views: colour, depth or height, labels (thesis 4.6.1, fig. 4.16).

    Noise and light are drawn for each view and applied to whole batches on their device.

    Args:
        images: stored or rendered views.
        noise: disturbs depth differently in every epoch, applied in the order of the names; noise
            of poses disturbs the heights that are made of it, and is left out if there are none.
        jitter: changes the light; None leaves it.
        seed: of noise and light.
        geometry: what the network sees, see `distance_images`.
    """

    kind = "views"

    def __init__(
        self,
        images: ViewImages,
        noise: Mapping[str, Noise] | None = None,
        jitter: ColourJitter | None = None,
        seed: int = 0,
        geometry: str = HEIGHT,
    ) -> None:
        self.images, self.jitter, self.seed, self.geometry = images, jitter, seed, geometry
        moving = geometry == HEIGHT  # nothing else depends on where the camera is believed to be
        self.noise = {
            name: noise_model
            for name, noise_model in sorted((noise or {}).items())
            if moving or not isinstance(noise_model, PoseNoise)
        }
        self._depth_noise = [n for n in self.noise.values() if not isinstance(n, PoseNoise)]
        self._pose_noise = [n for n in self.noise.values() if isinstance(n, PoseNoise)]
        self.classes = tuple(images.classes)

    def __len__(self) -> int:
        """Views of all scenes."""
        return len(self.images)

    def facts(self) -> dict[str, Any]:
        """What is seen, and how it is disturbed."""
        return {"scenes": len(self.images.source), "noise": described(self.noise)}

    def prepare(self, device: torch.device) -> None:
        """Does once what all batches need."""
        self.images.prepare(device)

    def batch(
        self, indices: NDArray[np.int64], epoch: int | None, device: torch.device
    ) -> SegmentationBatch:
        """Views for a training step: those of the epoch, with noise and light of their own.

        With `epoch=None`, as in validation, nothing is disturbed and they are always the same.
        """
        views = self.images.render(indices, epoch, device)
        if epoch is not None:
            streams = Streams.of(self.seed, _VIEW, epoch, indices=indices)
            views = self._disturbed(views, *streams.split(2 + len(self._pose_noise)))
        return self._batch(views)

    def _disturbed(
        self, views: LabelledViews, noise: Streams, light: Streams, *tracking: Streams
    ) -> LabelledViews:
        arrays: list[NDArray] = [np.ascontiguousarray(noise.seeds(len(self._depth_noise)).T)]
        for noise_model, draws in zip(self._pose_noise, tracking, strict=True):
            arrays.append(noise_model.moves(draws.uniform(noise_model.DRAWS)).astype(np.float32))
        if self.jitter is not None:
            arrays.append(self.jitter.draw(light).astype(np.float32))
        seeds, *changes = to_device(arrays, views.depth.device)
        depth, colour, poses = views.depth, views.colour, views.cameras.T_world_camera
        for disturb, row in zip(self._depth_noise, seeds, strict=True):
            depth = disturb.apply(depth, views.cameras, row)
        for move in changes[: len(tracking)]:
            # Not @: TF32 would round it, and a tenth of a millimetre of height with it
            poses = (poses[:, :, :, None] * move[:, None]).sum(dim=2)
        if self.jitter is not None:
            colour = self.jitter.apply(colour, changes[-1])
        cameras = replace(views.cameras, T_world_camera=poses)
        return replace(views, depth=depth, colour=colour, cameras=cameras)

    def _batch(self, views: LabelledViews) -> SegmentationBatch:
        distance = distance_images(views.depth, views.cameras, self.geometry)
        return SegmentationBatch(views.colour, distance[:, None], views.labels.long())


class StoredViews:
    """Views of a source that are the same in every epoch: for CPUs, or slow renderers.

    Args:
        source: the scenes.
        views: of each scene.
        memory: megabytes of views kept, the first ones; the others are fetched again.
    """

    def __init__(self, source: FrameSource, views: int = 40, memory: float = 1500.0) -> None:
        self.source, self.views = source, views
        self.classes = tuple(source.classes)
        self._bytes_left = memory * 1e6
        self._cached: dict[int, Frame] = {}

    def __len__(self) -> int:
        """Views of all scenes."""
        return len(self.source) * self.views

    def prepare(self, device: torch.device) -> None:
        """Fetches what there is room for, all views of a scene together, which is fastest."""
        for scene in track(range(len(self.source)), "fetching views"):
            for view, frame in enumerate(self.source.frames(scene, self.views)):
                if not self._keep(scene * self.views + view, _compact(frame)):
                    return

    def render(
        self, indices: NDArray[np.int64], epoch: int | None, device: torch.device
    ) -> LabelledViews:
        """The stored views, whatever the epoch."""
        frames = [self._cached.get(int(i)) or self._fetch(int(i)) for i in indices]
        cameras = stack_cameras([frame.camera for frame in frames])
        arrays = [np.stack([getattr(frame, name) for frame in frames]) for name in _ARRAYS]
        arrays += [cameras.intrinsics.numpy(), cameras.T_world_camera.numpy()]
        colour, depth, labels, *lenses = to_device(arrays, device)
        return LabelledViews(
            image_tensors(colour),
            depth,
            labels,
            CameraBatch(cameras.width, cameras.height, *lenses),
        )

    def _fetch(self, index: int) -> Frame:
        scene, view = divmod(index, self.views)
        return _compact(next(iter(self.source.frames(scene, 1, view))))

    def _keep(self, index: int, frame: Frame) -> bool:
        """Keeps a view in memory if there is room for it; returns whether there was."""
        arrays = (getattr(frame, name) for name in _ARRAYS)
        self._bytes_left -= sum(array.nbytes for array in arrays)
        if self._bytes_left >= 0:
            self._cached[index] = frame
        return self._bytes_left >= 0


class RenderedViews:
    """Views rendered in whole batches on the device that trains, from ever new cameras.

    Cameras are drawn as those of the source; views that are always the same are the source's own.
    With `renew` above 1 views stay on the device, 8 bytes per pixel, and an epoch renders one out
    of `renew` of them anew: for networks that are faster than the renderer.

    Args:
        source: the scenes; its renderer casts rays at their triangles.
        views: of each scene and epoch.
        renew: epochs in which a view is used.
        workers: processes that make the scenes when a training starts, -1 = one per core.
        seed: of cameras.
    """

    def __init__(
        self,
        source: TabletopScenes,
        views: int = 40,
        renew: int = 1,
        workers: int = -1,
        seed: int = 0,
    ) -> None:
        COUNT.require(renew=renew)
        self.source, self.views, self.renew, self.seed = source, views, renew, seed
        self.classes = tuple(source.classes)
        self._scenes = ResidentScenes(source, workers)
        self._cached: Pictures | None = None
        self._rounds = np.full(len(self), _NEVER)  # of the views that are kept

    def __len__(self) -> int:
        """Views of all scenes."""
        return len(self.source) * self.views

    def prepare(self, device: torch.device) -> None:
        """Brings all scenes to the device."""
        self._scenes.on(device)

    def render(
        self, indices: NDArray[np.int64], epoch: int | None, device: torch.device
    ) -> LabelledViews:
        """Views of an epoch; None = the source's own views."""
        lens = self.source.lens
        scenes, poses = self.poses(indices, epoch)
        intrinsics = np.array([[lens.fx, lens.fy, lens.cx, lens.cy]] * len(indices))
        lenses = camera_lenses(intrinsics, poses)
        small = [array.astype(np.float32) for array in (intrinsics, poses)]
        if epoch is None or self.renew == 1:
            *where, f, pose = to_device([scenes, lenses, *small], device)
            pictures = self._look(where, device)
            colour = pictures.colour.permute(0, 3, 1, 2)
        else:
            pictures, f, pose = self._renewed(indices, epoch, [scenes, lenses, *small], device)
            colour = image_tensors(pictures.colour)
        cameras = CameraBatch(lens.width, lens.height, f, pose)
        return LabelledViews(colour, pictures.distance, pictures.labels, cameras)

    def poses(
        self, indices: NDArray[np.int64], epoch: int | None
    ) -> tuple[NDArray[np.int32], Float64]:
        """Scenes (B,) and `T_world_camera` (B, 4, 4) of an epoch's views."""
        scenes, views = np.divmod(indices, self.views)
        if epoch is None:
            cameras = [
                self.source.camera(int(s), int(v)) for s, v in zip(scenes, views, strict=True)
            ]
            poses = np.stack([np.asarray(camera.T_world_camera) for camera in cameras])
        else:
            stream_indices = self._round(indices, epoch) * len(self) + indices
            streams = Streams.of(self.seed, _CAMERA, indices=stream_indices)
            poses = self.source.poses(streams.uniform(self.source.DRAWS))
        return scenes.astype(np.int32), poses

    def _round(self, indices: NDArray[np.int64], epoch: int) -> NDArray[np.int64]:
        """How often each view has been rendered anew by this epoch.

        Each is renewed once in `renew` epochs. The index is added so that in every epoch it is
        another part of the views, and no epoch has to render all of them.
        """
        return (epoch + indices) // self.renew

    def _look(self, where: Sequence[Tensor], device: torch.device) -> Pictures:
        lens = self.source.lens
        return self._scenes.on(device).render(where[0], where[1], (lens.width, lens.height))

    def _renewed(
        self,
        indices: NDArray[np.int64],
        epoch: int,
        arrays: Sequence[NDArray],
        device: torch.device,
    ) -> tuple[Pictures, Tensor, Tensor]:
        """Kept views, of which those of another round are rendered first; intrinsics and poses."""
        pool = self._pool(device)
        rounds = self._round(indices, epoch)
        new = np.flatnonzero(self._rounds[indices] != rounds)
        self._rounds[indices] = rounds
        tensors = to_device([indices, *arrays, indices[new], *(a[new] for a in arrays[:2])], device)
        places, _, _, intrinsics, poses, targets, *where = tensors
        if len(new):
            pictures = self._look(where, device)
            pool.distance[targets] = pictures.distance
            pool.labels[targets] = pictures.labels
            pool.colour[targets] = image(pictures.colour)
        selection = Pictures(pool.distance[places], pool.labels[places], pool.colour[places])
        return selection, intrinsics, poses

    def _pool(self, device: torch.device) -> Pictures:
        """All views on a device; on another one than before none is rendered yet."""
        device = torch.empty(0, device=device).device  # cuda becomes cuda:0
        if self._cached is None or self._cached.labels.device != device:
            self._rounds[:] = _NEVER
            lens = self.source.lens
            size = (len(self), lens.height, lens.width)
            self._cached = Pictures(
                torch.empty(size, device=device),
                torch.empty(size, dtype=torch.int8, device=device),
                torch.empty(*size, 3, dtype=torch.uint8, device=device),
            )
        return self._cached


def _compact(frame: Frame) -> Frame:
    """The frame with labels in a quarter of the memory.

    Raises:
        ConfigError: it has no colour or no labels.
    """
    if frame.colour is None or frame.labels is None:
        raise ConfigError(
            f"frame {frame.name} has no {'colour' if frame.colour is None else 'labels'}; "
            "training needs both"
        )
    return replace(frame, labels=frame.labels.astype(np.int8))
