"""A trained network as a method that turns partial views into complete, segmented scenes."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import torch
from torch.nn.functional import pad

from scenefw.core.batches import Completion
from scenefw.core.errors import ConfigError
from scenefw.data.batches.conditioning import condition, require_grid
from scenefw.perception.steps import Objects, ObjectSet
from scenefw.postprocessing.hough_voting import HoughVoting
from scenefw.representations.tsdf import TSDF
from scenefw.representations.vote_field import VoteField

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from torch import Tensor, nn

    from scenefw.core.batches import PartialTSDF
    from scenefw.core.protocols import InstanceExtractor, Representation
    from scenefw.core.training_protocols import ShapeInstanceModel, TrainedOnGrid
    from scenefw.core.types import GridSpec, Int32
    from scenefw.perception.observation.observation import Observation
    from scenefw.perception.observation.views import View
    from scenefw.perception.steps import Fits


_CODES_AT_ONCE = 5  # of which the network encodes the view once


class VolumeNetwork:
    """Completes partial TSDFs with a trained network and several latent codes (SIMstack).

    The first sample decodes the zero code, the most typical scene; the others decode codes from
    N(0, I), times the temperature, that are drawn together (`coupled_codes`). A network without
    codes gives one sample.

    Args:
        checkpoint: a loaded checkpoint; its grid is the grid of everything here.
        extractor: from TSDF and centre votes to instances; None: Hough voting.
        device: where the network runs.
        smoothing: standard deviation (voxels) of a Gaussian over predicted distances, 0 for none.
            The network's last layer predicts blocks of 2^3 voxels, whose pattern would show as
            bumps on the surface.
        temperature: standard deviation of drawn codes. Below 1 samples are more typical and differ
            less (the truncation of Brock et al. 2019).
        representations: of the volumes that come out, by name; tsdf and, where the network has
            them, votes are among them, and each is an output of the network. None: these alone. The
            extractor of a network without votes is given zeros: take one that needs none.
        typical_first: without it all samples are drawn.
        coupled: codes are drawn together; without it independently, as in the thesis.

    Raises:
        ConfigError: smoothing or temperature is negative, or the network lacks an output.
    """

    def __init__(
        self,
        checkpoint: TrainedOnGrid[ShapeInstanceModel],
        extractor: InstanceExtractor | None = None,
        device: str = "cpu",
        smoothing: float = 0.6,
        temperature: float = 1.0,
        representations: Mapping[str, Representation] | None = None,
        *,
        typical_first: bool = True,
        coupled: bool = True,
    ) -> None:
        if smoothing < 0 or temperature < 0:
            raise ConfigError(
                f"smoothing is {smoothing}, temperature {temperature}; expected voxels and a "
                "standard deviation of at least 0"
            )
        standard: dict[str, Representation] = {"tsdf": TSDF()}
        if "votes" in checkpoint.model.outputs:
            standard["votes"] = VoteField()
        self.representations = {**standard, **(representations or {})}
        _require_outputs(self.representations, checkpoint.model.outputs)
        self.grid = checkpoint.grid
        self.metadata = dict(checkpoint.metadata)
        self.extractor = HoughVoting() if extractor is None else extractor
        self.smoothing, self.temperature = smoothing, temperature
        self.typical_first, self.coupled = typical_first, coupled
        self.device = torch.device(device)
        self.model = _prepare(checkpoint.model, self.device)

    @torch.no_grad()
    def volumes(
        self, partial: PartialTSDF, grid: GridSpec, samples: int, generator: torch.Generator
    ) -> list[dict[str, Tensor]]:
        """Volumes (B, C, X, Y, Z) of each of `samples` codes, by name of their representations.

        At temperature 0 there is one, as all would be the same.

        Raises:
            InputError: the grid is not the one that the network was trained on.
        """
        inputs = self.inputs(partial, grid)
        return self._decode(inputs, grid, self._codes(samples, len(inputs), generator))

    def inputs(self, partial: PartialTSDF, grid: GridSpec) -> Tensor:
        """What the network sees of partial views.

        Raises:
            InputError: the grid is not the one that the network was trained on.
        """
        require_grid(grid, self.grid)
        inputs = condition(partial, grid)
        return inputs.to(self.device, memory_format=_memory_format(self.device))

    @torch.no_grad()
    def complete_with(
        self, partial: PartialTSDF, grid: GridSpec, codes: Tensor
    ) -> list[Completion]:
        """Complete scenes of given codes (S, B, latent_size)."""
        return self._completions(self._decode(self.inputs(partial, grid), grid, codes), grid)

    def _decode(self, inputs: Tensor, grid: GridSpec, all_codes: Tensor) -> list[dict[str, Tensor]]:
        results = []
        for codes in all_codes.split(_CODES_AT_ONCE):
            outputs = dict(self.model.predict(inputs, codes.flatten(0, 1).to(self.device)).volumes)
            outputs["tsdf"] = smoothed(outputs["tsdf"].float().clamp(-1, 1), self.smoothing)
            volumes = {
                n: representation.from_network(outputs[n], grid)
                for n, representation in self.representations.items()
            }
            for row in range(len(codes)):
                part = slice(row * len(inputs), (row + 1) * len(inputs))
                results.append({name: volume[part] for name, volume in volumes.items()})
        return results

    def _codes(self, samples: int, views: int, generator: torch.Generator) -> Tensor:
        """Codes (S, B, latent_size), on the CPU: the same on every device."""
        shape = (views, self.model.latent_size)
        if not self.temperature or not self.model.latent_size:
            return torch.zeros(1, *shape)
        typical = torch.zeros(int(self.typical_first), *shape)
        draw = coupled_codes if self.coupled else independent_codes
        codes = draw(samples - len(typical), shape, generator)
        return torch.cat([typical, self.temperature * codes])

    def complete(
        self, fits: Fits, view: Observation, samples: int, generator: torch.Generator
    ) -> list[ObjectSet]:
        """Complete scenes of `samples` codes, with all their volumes; fits count for nothing."""
        volumes = self.volumes(view.partial, view.grid, samples, generator)
        return [ObjectSet(objects_of(scene)) for scene in self._completions(volumes, view.grid)]

    def group(self, segments: Int32 | None, view: View) -> Objects:
        """The most typical scene as rough volumes of segments (`grouping.relabelling`)."""
        return self.typical(view)

    def typical(self, view: View) -> Objects:
        """The most typical scene of a view, which needs no image."""
        codes = torch.zeros(1, 1, self.model.latent_size)
        return objects_of(self.complete_with(view.partial, view.grid, codes)[0])

    def _completions(
        self, volumes: Sequence[dict[str, Tensor]], grid: GridSpec
    ) -> list[Completion]:
        return [
            Completion(sample["tsdf"][:, 0], self._instances(sample, grid), sample)
            for sample in volumes
        ]

    def _instances(self, volumes: Mapping[str, Tensor], grid: GridSpec) -> Tensor:
        tsdf = volumes["tsdf"]
        votes = volumes.get("votes", tsdf.new_zeros(1, 3, 1, 1, 1).expand(-1, -1, *tsdf.shape[2:]))
        pairs = zip(tsdf[:, 0], votes.expand(len(tsdf), -1, -1, -1, -1), strict=True)
        return torch.stack([self.extractor.extract(tsdf, votes, grid)[0] for tsdf, votes in pairs])


def objects_of(scene: Completion) -> Objects:
    """Predicted volumes of a scene, a batch of one, as objects of which no pixel is known."""
    tsdf, instances = scene.tsdf[0].cpu().numpy(), scene.instances[0].cpu().numpy()
    return Objects(None, tsdf, instances, scene.volumes)


def _require_outputs(
    representations: Mapping[str, Representation], outputs: Mapping[str, int]
) -> None:
    for name, representation in representations.items():
        if outputs.get(name) != representation.channels:
            raise ConfigError(
                f"the network has no output {name} of {representation.channels} channels, its "
                f"outputs are {', '.join(f'{n} ({c})' for n, c in outputs.items())}; give a "
                "checkpoint that was trained on it, or leave it out of representation=[...]"
            )


def _prepare(model: nn.Module, device: torch.device) -> ShapeInstanceModel:
    return model.to(device).eval()


def independent_codes(samples: int, shape: tuple[int, ...], generator: torch.Generator) -> Tensor:
    """Codes (S, *shape) from N(0, I)."""
    return torch.randn((samples, *shape), generator=generator)


def coupled_codes(samples: int, shape: tuple[int, ...], generator: torch.Generator) -> Tensor:
    """Codes (S, *shape), each from N(0, I), that differ as much as such codes can.

    They add up to zero: two are opposite, and any two of S have the correlation -1 / (S - 1), the
    least that all pairs can have (extreme antithesis, Craiu and Meng 2005). Means over them vary
    less than those over independent codes, and few of them show more of what a view allows.
    """
    codes = independent_codes(samples, shape, generator)
    if samples < 2:
        return codes
    return (codes - codes.mean(dim=0)) * math.sqrt(samples / (samples - 1))


def smoothed(volumes: Tensor, sigma: float) -> Tensor:
    """Volumes (B, 1, X, Y, Z) convolved with a Gaussian cut at three sigma, borders repeated.

    Shifted volumes are added up: a convolution of one channel takes ten times as long on CPUs.
    """
    if sigma == 0:
        return volumes
    radius = math.ceil(3 * sigma)
    weights = [math.exp(-0.5 * (offset / sigma) ** 2) for offset in range(radius + 1)]
    total = weights[0] + 2 * sum(weights[1:])
    for axis in (2, 3, 4):
        borders = [0] * 6
        borders[2 * (4 - axis)] = borders[2 * (4 - axis) + 1] = radius
        padded, size = pad(volumes, borders, mode="replicate"), volumes.shape[axis]
        volumes = padded.narrow(axis, radius, size) * (weights[0] / total)
        for offset in range(1, radius + 1):
            for start in (radius - offset, radius + offset):
                volumes.add_(padded.narrow(axis, start, size), alpha=weights[offset] / total)
    return volumes


def _memory_format(device: torch.device) -> torch.memory_format:
    return torch.channels_last_3d if device.type == "cuda" else torch.contiguous_format
