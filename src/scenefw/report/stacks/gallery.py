"""Shows examples: a picture and the predicted meshes of each."""

from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np
import torch

from scenefw.core.types import Frame, SceneEstimate
from scenefw.evaluation.stacks.examples import Example, Examples
from scenefw.perception.objects import estimate_objects
from scenefw.postprocessing.surfaces import instance_meshes
from scenefw.report.blocks import Picture
from scenefw.report.palette import Colour, instance_colours
from scenefw.report.pictures import save_picture
from scenefw.report.stacks.examples import draw_example


class Gallery:
    """Draws examples and writes their meshes into a run's folder.

    Args:
        examples: makes them.
        output: the run's folder; files go to `gallery` in it.
        write_mesh: writes the predicted scene to a file, each object in its colour.
    """

    def __init__(
        self,
        examples: Examples,
        output: str | Path,
        write_mesh: Callable[[Path, SceneEstimate, Sequence[Colour]], object],
    ) -> None:
        self.examples = examples
        self.write_mesh = write_mesh
        self.output = Path(output)

    def show(self) -> tuple[Picture, ...]:
        """One picture per example, with links to its mesh.

        Raises:
            StorageError: the folder can't be written.
        """
        return tuple(self._picture(example) for example in self.examples.make())

    def _picture(self, example: Example) -> Picture:
        name = f"gallery/{example.name.replace(' ', '_')}"
        save_picture(draw_example(example), self.output / f"{name}.jpg")
        estimate = estimated(example)
        colours = instance_colours(max((item.id for item in estimate.objects), default=0))
        chosen = [colours[item.id - 1] for item in estimate.objects]
        self.write_mesh(self.output / f"{name}.glb", estimate, chosen)
        found, true = len(estimate.objects), len(np.unique(example.true_instances)) - 1
        caption = f"{example.name}: {found} objects predicted, {true} in truth"
        return Picture(f"{name}.jpg", caption, (("mesh (GLB)", f"{name}.glb"),))


def estimated(example: Example) -> SceneEstimate:
    """The prediction of an example as meshes."""
    tsdf, instances = torch.from_numpy(example.tsdf), torch.from_numpy(example.instances)
    meshes = instance_meshes(tsdf, instances, example.grid)
    frame = Frame(example.depth, example.camera, name=example.name)
    objects = estimate_objects(meshes, {})
    return SceneEstimate(objects, example.grid, example.tsdf, example.instances, frame)
