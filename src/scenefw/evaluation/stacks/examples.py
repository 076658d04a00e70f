"""A few test views with predictions and truth, for pictures."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
import torch

from scenefw.core import rng
from scenefw.core.errors import ConfigError
from scenefw.core.protocols import MappingMethod, Noise, Reconstructor, Renderer
from scenefw.core.types import Camera, Float32, GridSpec, Int32
from scenefw.data.batches.stacks import SceneSet
from scenefw.data.batches.views import ViewMaker, Viewpoints
from scenefw.kernels.cameras import camera_of
from scenefw.matching.instances import renumbered_like

_STREAM = 5  # random stream of views; evaluation has its own


@dataclass(frozen=True)
class Example:
    """One view of one scene, its truth and a prediction.

    Args:
        name: of the scene.
        grid: the voxel grid of all volumes.
        depth: (H, W) z-depth (m).
        camera: that saw it.
        partial: (X, Y, Z) partial TSDF (m).
        tsdf: (X, Y, Z) predicted (m).
        instances: (X, Y, Z) predicted labels; those that fit a true object have its label.
        true_tsdf: (X, Y, Z) metres.
        true_instances: (X, Y, Z) labels.
        further_samples: TSDF and instances, as above, of further samples.
    """

    name: str
    grid: GridSpec
    depth: Float32
    camera: Camera
    partial: Float32
    tsdf: Float32
    instances: Int32
    true_tsdf: Float32
    true_instances: Int32
    further_samples: tuple[tuple[Float32, Int32], ...] = ()


class Examples:
    """Views that do not depend on their number.

    Args:
        scenes: of the split to show.
        method: completes them; views are on its grid, which it must have.
        viewpoints: draws cameras.
        renderer: makes depth images.
        mapping: from depth to partial TSDF.
        noise: disturbs the depth images.
        count: how many scenes, spread evenly over the split.
        seed: of viewpoints and codes.
        device: where volumes and views are computed.
        samples: codes per scene.

    Raises:
        ConfigError: the method has no grid.
    """

    def __init__(
        self,
        scenes: SceneSet,
        method: Reconstructor,
        viewpoints: Viewpoints,
        renderer: Renderer,
        mapping: MappingMethod,
        noise: Mapping[str, Noise] | None = None,
        count: int = 4,
        seed: int = 0,
        device: str = "cpu",
        samples: int = 4,
    ) -> None:
        if method.grid is None:
            raise ConfigError("the method of examples has no grid; give gallery.examples.method")
        self.scenes = scenes
        self.views = ViewMaker(method.grid, viewpoints, renderer, mapping, noise)
        self.method = method
        self.count = count
        self.seed = seed
        self.device = device
        self.samples = samples

    def make(self) -> tuple[Example, ...]:
        """The examples, in the order of their scenes."""
        positions = np.linspace(0, len(self.scenes) - 1, min(self.count, len(self.scenes)))
        return tuple(self._example(int(i)) for i in np.unique(positions.astype(int)))

    @torch.no_grad()
    def _example(self, scene: int) -> Example:
        parameters = self.scenes.parameters([scene], self.device)
        view = self.views.make_one(parameters, rng.generator(self.seed, _STREAM, scene))
        codes = torch.Generator().manual_seed(rng.torch_seed(self.seed, _STREAM, scene))
        grid = self.views.grid
        true = view.volumes.instances[0].cpu().numpy()
        samples = self.method.complete(view.partial, grid, self.samples, codes)
        (tsdf, instances), *further_samples = [
            (sample.tsdf[0].cpu().numpy(), renumbered_like(sample.instances[0].cpu().numpy(), true))
            for sample in samples
        ]
        return Example(
            f"scene {int(self.scenes.indices[scene])}",
            grid,
            view.depth[0].cpu().numpy(),
            camera_of(view.cameras, 0),
            view.partial.distance[0, 0].cpu().numpy(),
            tsdf,
            instances,
            view.volumes.tsdf[0, 0].cpu().numpy(),
            true,
            tuple(further_samples),
        )
