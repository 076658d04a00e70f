"""Crops of height maps as samples for labelling networks; whole maps stay on the device."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np
import torch
from numpy.typing import NDArray
from rich.progress import track
from torch import Tensor

from scenefw.core.batches import SegmentationBatch
from scenefw.core.errors import ConfigError
from scenefw.core.height_maps import HeightMap
from scenefw.core.labelling_protocols import FrameSource
from scenefw.core.labels import UNKNOWN
from scenefw.core.rng import Streams
from scenefw.core.settings import COUNT, NOT_NEGATIVE, SHARE
from scenefw.core.types import Float64
from scenefw.kernels.compile import float32
from scenefw.kernels.depth_noise import add_noise
from scenefw.kernels.transfer import to_device
from scenefw.labelling.network_inputs import HEIGHT, image_tensors
from scenefw.renderers.mesh_raycaster import image
from scenefw.renderers.tables import map_lens
from scenefw_tabletops.data.light import ColourJitter
from scenefw_tabletops.data.resident import ResidentScenes
from scenefw_tabletops.data.table_scenes import TabletopScenes

_CROP, _HELD_OUT = 6, 7  # random streams
_LIFT = 1.0  # m: the kernel of white noise leaves what is not above 0


@dataclass(frozen=True)
class LabelledMaps:
    """S maps on a device, 8 bytes per vertex.

    Args:
        colour: (S, V, V, 3) uint8.
        heights: (S, V, V) float32 metres, NaN = unseen.
        labels: (S, V, V) int8 class ids, -1 = unknown.
    """

    colour: Tensor
    heights: Tensor
    labels: Tensor


class MapImages(Protocol):
    """Whole labelled maps."""

    @property
    def classes(self) -> Sequence[str]:
        """Names by class id."""

    def __len__(self) -> int:
        """Number of maps."""

    def facts(self) -> dict[str, Any]:
        """How they were made, as plain data; true maps have only a spacing."""

    def load(self, device: torch.device) -> LabelledMaps:
        """All maps, on a device."""


class MapCrops:
    """Crops of height maps: colour, height above the table, labels (thesis 4.6.1, fig. 4.17).

    Args:
        maps: true or fused maps.
        crops: of each scene and epoch.
        size: width and height of a crop (vertices), cut to the maps' where it is larger.
        jitter: changes the light; None leaves it.
        height_noise: standard deviation of noise on heights (m), as fused maps are not smooth.
        unseen: share of crops in which a random line cuts off a part as unseen, as maps have that
            are not finished.
        seed: of places, flips, noise and light.
        flips: mirror crops at random, for classes that don't tell left from right.

    Raises:
        ConfigError: no crop, noise below 0, or a share that is none.
    """

    kind = "maps"
    geometry = HEIGHT

    def __init__(
        self,
        maps: MapImages,
        crops: int = 8,
        size: Sequence[int] = (320, 240),
        jitter: ColourJitter | None = None,
        height_noise: float = 0.0,
        unseen: float = 0.0,
        seed: int = 0,
        *,
        flips: bool = True,
    ) -> None:
        COUNT.require(crops=crops, size=size)
        NOT_NEGATIVE.require(height_noise=height_noise)
        SHARE.require(unseen=unseen)
        self.maps, self.crops, self.jitter = maps, crops, jitter
        self.size = (int(size[0]), int(size[1]))
        self.height_noise, self.unseen, self.seed, self.flips = height_noise, unseen, seed, flips
        self.classes = tuple(maps.classes)
        self._resident: dict[torch.device, LabelledMaps] = {}

    def __len__(self) -> int:
        """Crops of all scenes."""
        return len(self.maps) * self.crops

    def facts(self) -> dict[str, Any]:
        """What maps they are cut from, and how they are disturbed."""
        facts = {"scenes": len(self.maps), "height_noise": self.height_noise, "unseen": self.unseen}
        return {**facts, **self.maps.facts()}

    def prepare(self, device: torch.device) -> None:
        """Brings all maps to the device."""
        if device not in self._resident:
            self._resident[device] = self.maps.load(device)

    def batch(
        self, indices: NDArray[np.int64], epoch: int | None, device: torch.device
    ) -> SegmentationBatch:
        """Crops of scenes index // crops, elsewhere in every epoch; None = the same always."""
        self.prepare(device)
        stream = (_HELD_OUT,) if epoch is None else (_CROP, epoch)
        streams = Streams.of(self.seed, *stream, indices=indices)
        where, light, noise, line = streams.split(4)
        changed = epoch is not None
        arrays = [indices // self.crops, *self._places(where, flips=changed and self.flips)]
        if changed:
            arrays += [noise.seeds(1)[:, 0], self._lines(line).astype(np.float32)]
            arrays += [self.jitter.draw(light).astype(np.float32)] if self.jitter else []
        scenes, rows, columns, *changes = to_device(arrays, device)
        crop = self._crop(self._resident[device], scenes, rows, columns)
        return self._changed(crop, *changes) if changed else crop

    def _places(self, where: Streams, *, flips: bool) -> list[NDArray[np.int64]]:
        """Rows (B, H) and columns (B, W) of each crop, backwards where it is flipped."""
        vertices = next(iter(self._resident.values())).labels.shape[-1]
        draws, indices = where.uniform(4), []
        for axis, length in enumerate(self.size[::-1]):
            first = (draws[:, axis] * (max(vertices - length, 0) + 1)).astype(np.int64)
            along = np.arange(min(length, vertices))
            flipped = (draws[:, 2 + axis, None] < 0.5) & flips
            indices.append(first[:, None] + np.where(flipped, along[::-1], along))
        return indices

    def _lines(self, streams: Streams) -> Float64:
        """Row, column (pixels) and direction of the line of each crop; NaN = no line."""
        draws = streams.uniform(4)
        angle, no_line = 2 * np.pi * draws[:, 2], draws[:, 3] >= self.unseen
        place = draws[:, :2] * self.size[::-1]
        lines = np.column_stack([place, np.sin(angle), np.cos(angle)])
        lines[no_line] = np.nan
        return lines

    def _crop(
        self, maps: LabelledMaps, scenes: Tensor, rows: Tensor, columns: Tensor
    ) -> SegmentationBatch:
        at = (scenes[:, None, None], rows[:, :, None], columns[:, None, :])
        return SegmentationBatch(
            image_tensors(maps.colour[at]), maps.heights[at][:, None], maps.labels[at].long()
        )

    def _changed(
        self, crop: SegmentationBatch, seeds: Tensor, lines: Tensor, *factors: Tensor
    ) -> SegmentationBatch:
        colour = self.jitter.apply(crop.colour, *factors) if self.jitter else crop.colour
        heights = self._noisy(crop.distance, seeds)
        hidden = _hidden_mask(lines, crop.labels)
        return SegmentationBatch(
            colour.masked_fill(hidden[:, None], 0.0),
            heights.masked_fill(hidden[:, None], torch.nan),
            crop.labels.masked_fill(hidden, UNKNOWN),
        )

    def _noisy(self, heights: Tensor, seeds: Tensor) -> Tensor:
        if self.height_noise == 0:
            return heights
        lifted = torch.nan_to_num(heights, nan=-_LIFT).contiguous() + _LIFT  # kernels bear no NaN
        noisy = torch.empty_like(lifted)
        flat = (lifted.view(-1), seeds, noisy.view(-1))
        add_noise(
            heights.numel(),
            *flat,
            heights[0].numel(),
            *float32(self.height_noise, self.height_noise, 1.0),
        )
        return torch.where(heights.isnan(), heights, noisy - _LIFT)


def _hidden_mask(lines: Tensor, labels: Tensor) -> Tensor:
    """(B, H, W) whether pixels lie on one side of their crop's line; none where it is NaN."""
    row, column, sine, cosine = lines[:, :, None, None].unbind(1)
    y = torch.arange(labels.shape[1], device=labels.device)[:, None]
    x = torch.arange(labels.shape[2], device=labels.device)
    return (y - row) * sine + (x - column) * cosine > 0


class Fused(Protocol):
    """Makes the fused map of a scene."""

    def __call__(self, scene: int) -> HeightMap:
        """The map of a scene by its number."""

    def facts(self) -> dict[str, Any]:
        """How maps are fused, as plain data."""


class StoredMaps:
    """Maps of a source, made on the host.

    Args:
        source: the scenes, with their true labels.
        fused: gives the fused map of a scene by its number; None takes the true maps.
    """

    def __init__(self, source: FrameSource, fused: Fused | None = None) -> None:
        self.source, self.fused = source, fused
        self.classes = tuple(source.classes)

    def __len__(self) -> int:
        """Number of scenes."""
        return len(self.source)

    def facts(self) -> dict[str, Any]:
        """Their spacing (m), and how they were fused."""
        spacing = self.source.truth(0).grid.spacing
        return {"spacing": spacing, **({} if self.fused is None else self.fused.facts())}

    def load(self, device: torch.device) -> LabelledMaps:
        """All maps, on a device."""
        scenes = track(range(len(self)), "fetching maps")
        return stacked((self.arrays(scene) for scene in scenes), device)

    def arrays(self, scene: int) -> tuple[NDArray, NDArray, NDArray]:
        """Colour (V, V, 3) uint8, heights (V, V) float32 and labels (V, V) int8 of a map.

        Raises:
            ConfigError: a fused map lies on another grid than the truth, or that has no labels.
        """
        truth = self.source.truth(scene)
        height_map = truth if self.fused is None else self.fused(scene)
        if truth.labels is None or height_map.heights.shape != truth.labels.shape:
            raise ConfigError(
                f"the map of scene {scene} has {height_map.heights.shape} vertices and its truth "
                f"{truth.heights.shape} with{'' if truth.labels is not None else 'out'} labels; "
                "give maps and truth on one grid"
            )
        labels = np.where(height_map.seen, truth.labels, UNKNOWN).astype(np.int8)
        return height_map.colour, height_map.heights, labels


class RenderedMaps:
    """True maps, rendered on the device that trains when a training starts.

    Args:
        source: the scenes; its renderer casts rays at their triangles.
        workers: processes that make the scenes, -1 = one per core.
    """

    def __init__(self, source: TabletopScenes, workers: int = -1) -> None:
        self.source = source
        self.classes = tuple(source.classes)
        self._scenes = ResidentScenes(source, workers)

    def __len__(self) -> int:
        """Number of scenes."""
        return len(self.source)

    def facts(self) -> dict[str, Any]:
        """Their spacing (m); else nothing: they are true."""
        return {"spacing": self.source.grid.spacing}

    def load(self, device: torch.device) -> LabelledMaps:
        """All maps, on a device."""
        grid, scenes = self.source.grid, self._scenes.on(device)
        size = (len(self), *grid.shape)
        colour = torch.empty(*size, 3, dtype=torch.uint8, device=device)
        heights = torch.empty(size, device=device)
        labels = torch.empty(size, dtype=torch.int8, device=device)
        for scene, top in enumerate(scenes.tops.tolist()):
            row = torch.tensor([scene], dtype=torch.int32, device=device)
            lens = torch.from_numpy(map_lens(grid, top)[None]).to(device)
            pictures = scenes.render(row, lens, (grid.vertices, grid.vertices))
            colour[scene] = image(pictures.colour[0])
            heights[scene] = (top - pictures.distance[0]).clamp(min=0)
            labels[scene] = pictures.labels[0]
        return LabelledMaps(colour, heights, labels)


def stacked(maps: Iterable[tuple[NDArray, NDArray, NDArray]], device: torch.device) -> LabelledMaps:
    """Colour, heights and labels of maps of one size, on a device."""
    tensors = [tuple(torch.from_numpy(a).to(device) for a in arrays) for arrays in maps]
    return LabelledMaps(*(torch.stack(parts) for parts in zip(*tensors, strict=True)))
