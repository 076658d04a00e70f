"""Shows examples: scenes to turn, a picture and the predicted meshes of each."""

from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np
import torch

from scenefw.core.types import Float32, Frame, Int32, SceneEstimate
from scenefw.evaluation.stacks.examples import Example, Examples
from scenefw.perception.estimate.objects import estimate_objects
from scenefw.postprocessing.surfaces import instance_meshes
from scenefw.report.blocks import Picture, Scenes
from scenefw.report.palette import Colour, instance_colours
from scenefw.report.pictures import save_picture
from scenefw.report.scenes3d import Layer, Scene3D, layer, packed
from scenefw.report.stacks.examples import draw_example

_CAPTION = "To turn: predicted, truth, further samples (slider), points of the depth image"


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

    def show(self) -> tuple[Scenes | Picture, ...]:
        """All examples to turn, then one picture per example, with links to its mesh.

        Raises:
            StorageError: the folder can't be written.
        """
        examples = list(self.examples.make())
        if not examples:
            return ()
        scenes = packed([_scene(example) for example in examples], _CAPTION)
        return scenes, *(self._picture(example) for example in examples)

    def _picture(self, example: Example) -> Picture:
        name = f"gallery/{example.name.replace(' ', '_')}"
        save_picture(draw_example(example), self.output / f"{name}.jpg")
        estimate = estimated(example)
        self.write_mesh(self.output / f"{name}.glb", estimate, _colours(estimate))
        predicted_count, true_count = (
            len(estimate.objects),
            len(np.unique(example.true_instances)) - 1,
        )
        caption = f"{example.name}: {predicted_count} objects predicted, {true_count} in truth"
        return Picture(f"{name}.jpg", caption, (("mesh (GLB)", f"{name}.glb"),))


def estimated(example: Example) -> SceneEstimate:
    """The prediction of an example as meshes."""
    return _meshed(example, example.tsdf, example.instances)


def _meshed(example: Example, distances: Float32, labels: Int32) -> SceneEstimate:
    tsdf, instances = torch.from_numpy(distances), torch.from_numpy(labels)
    meshes = instance_meshes(tsdf, instances, example.grid)
    frame = Frame(example.depth, example.camera, name=example.name)
    objects = estimate_objects(meshes, {})
    return SceneEstimate(objects, example.grid, distances, labels, frame)


def _scene(example: Example) -> Scene3D:
    """Prediction, truth and further samples."""
    volumes = {
        "predicted": (example.tsdf, example.instances),
        "truth": (example.true_tsdf, example.true_instances),
    }
    volumes |= {
        f"sample {number}": volume for number, volume in enumerate(example.further_samples, start=2)
    }
    return Scene3D(
        example.name,
        tuple(_layer(name, _meshed(example, *volume)) for name, volume in volumes.items()),
        Frame(example.depth, example.camera, name=example.name),
    )


def _layer(name: str, estimate: SceneEstimate) -> Layer:
    return layer(name, estimate, _colours(estimate), confidence=False, supports=False)


def _colours(estimate: SceneEstimate) -> list[Colour]:
    """Of the objects, in their order."""
    colours = instance_colours(max((item.id for item in estimate.objects), default=0))
    return [colours[item.id - 1] for item in estimate.objects]
