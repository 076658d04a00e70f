"""What is predicted from one image: objects, hypotheses, files, pictures."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from scenefw.api.formats import writer
from scenefw.core.errors import InputError
from scenefw.core.types import Camera

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from scenefw.core.types import ObjectEstimate, SceneEstimate


@dataclass(frozen=True)
class Prediction:
    """Scenes that fit one image, in the world frame: z up, floor z = 0, metres.

    Args:
        samples: the most typical scene first, then drawn ones; an object has the same id in all.
    """

    samples: tuple[SceneEstimate, ...]

    @property
    def estimate(self) -> SceneEstimate:
        """The most typical scene: objects, volumes, masks, frame and details."""
        return self.samples[0]

    @property
    def objects(self) -> tuple[ObjectEstimate, ...]:
        """Its objects, each with `id`, `mesh`, `pose`, `extents`, `confidence` and `placed`."""
        return self.estimate.objects

    @property
    def masks(self) -> NDArray[np.int32] | None:
        """(H, W) id of the object that each pixel shows, 0 = none."""
        return self.estimate.masks

    @property
    def camera(self) -> Camera:
        """The image's camera, with its estimated pose."""
        return self.estimate.frame.camera

    @property
    def warnings(self) -> tuple[str, ...]:
        """What looks odd about the image, one line each."""
        return tuple(self.estimate.details.get("warnings", ()))

    def __repr__(self) -> str:
        name = self.estimate.frame.name
        return f"Prediction({name!r}, {len(self.objects)} objects, {len(self.samples)} samples)"

    def save(self, path: str | Path, *, sample: int = 0, **settings: Any) -> Path:
        """Writes a scene; the suffix chooses the format.

        Args:
            path: `.glb`, `.ply`, `.obj`; `.json` with poses and sizes, `.superquadrics.json`;
                `.urdf` and `.xml` (MJCF) for simulators.
            sample: which of the scenes.
            settings: of the format, such as `density=300.0` (kg/m^3) for simulators.

        Returns:
            The path.

        Raises:
            InputError: an unknown suffix or setting, or no such sample.
            StorageError: the file can't be written.
        """
        path, estimate = Path(path), self._sample(sample)
        writer(path, settings).write(path, estimate, _colours(estimate))
        return path

    def render(
        self, camera: Camera | None = None, *, turn: float = 0.0, sample: int = 0
    ) -> NDArray[np.uint8]:
        """A picture of a scene, RGB (H, W, 3) uint8, every object in its colour.

        Args:
            camera: from where; None = the image's own.
            turn: degrees to go around the objects from there; then they fill the picture.
            sample: which of the scenes.

        Raises:
            InputError: what was given is no camera, or no such sample.
        """
        from scenefw.report.overview import by_label, vertices
        from scenefw.report.shading import Solid, draw, turned
        from scenefw.report.two_sides import of_objects

        camera, estimate = camera or self.camera, self._sample(sample)
        if not isinstance(camera, Camera):
            raise InputError(
                f"render takes a scenefw.core.types.Camera, got a {type(camera).__name__}; leave "
                "it out for the image's own, and give turn=150 to look from behind"
            )
        if turn:
            camera = turned(camera, vertices(estimate), turn)
        colours = by_label(estimate, _colours(estimate))
        solid = Solid(of_objects(estimate), estimate.instances, estimate.grid, colours)
        return np.rint(np.clip(draw(solid, camera), 0, 1) * 255).astype(np.uint8)

    def _sample(self, number: int) -> SceneEstimate:
        if not 0 <= number < len(self.samples):
            raise InputError(
                f"there is no sample {number}; give one of 0 to {len(self.samples) - 1}"
            )
        return self.samples[number]


def _colours(estimate: SceneEstimate) -> Sequence[Any]:
    from scenefw.report.palette import instance_colours

    ids = [item.id for item in estimate.objects]
    palette = instance_colours(max(ids, default=0))
    return [palette[i - 1] for i in ids]
