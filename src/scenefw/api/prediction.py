"""What is predicted from one image: objects, hypotheses, files, pictures."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from scenefw.api.output import render, save
from scenefw.core.errors import ConfigError, InputError, require_whole
from scenefw.perception.estimate.base_frame import TRACKS

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import ArrayLike, NDArray

    from scenefw.core.types import Camera, ObjectEstimate, SceneEstimate
    from scenefw.perception.ranking.next_view import ViewScore


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

    @property
    def tracks(self) -> tuple[dict[str, Any], ...]:
        """What each object did, of a prediction by `Predictor.track`; else empty.

        `id`, `state` (new, still, moved, hidden, gone), `since` which image, and, of those that
        moved, `motion` (4, 4) from its place before, in the world frame.
        """
        return tuple(self.estimate.details.get(TRACKS, ()))

    @cached_property
    def spread(self) -> dict[int, NDArray[np.float32]]:
        """Of each object, by id, how far its vertices (V,) lie from the other samples' (m).

        The root mean square; objects that no other sample holds are left out.
        """
        from scenefw.perception.estimate.surface_spread import surface_spread

        return surface_spread(self.estimate, self.samples[1:])

    def __repr__(self) -> str:
        name = self.estimate.frame.name
        return f"Prediction({name!r}, {len(self.objects)} objects, {len(self.samples)} samples)"

    def scene(self, sample: int = 0) -> Any:
        """A scene to change (plugin `editing`): remove, move, scale and add objects, settle, save.

        Args:
            sample: which of the scenes.

        Raises:
            InputError: there is no such sample.
            ConfigError: the plugin `editing` is missing.
        """
        from scenefw.api.load import loaders

        source = loaders().get("scene")
        if source is None:
            raise ConfigError(
                "scene() needs the plugin editing, which is missing; install scenefw with its "
                "plugins"
            )
        return source.of(self._sample(sample))

    def save(self, path: str | Path, *, sample: int = 0, **settings: Any) -> Path:
        """Writes a scene; the suffix chooses the format.

        Args:
            path: `.glb`, `.ply`, `.obj`; `.json` with poses and sizes, `.superquadrics.json`;
                `.urdf` and `.xml` (MJCF) for simulators. Without a suffix it is a folder as of
                `run=predict`.
            sample: which of the scenes.
            settings: of the format, such as `density=300.0` (kg/m^3) for simulators.

        Returns:
            The path.

        Raises:
            InputError: an unknown suffix or setting, or no such sample.
            StorageError: the file can't be written.
        """
        return save(self._sample(sample), path, settings)

    def next_views(
        self, poses: Sequence[ArrayLike] | None = None, *, count: int = 48
    ) -> list[ViewScore]:
        """Where to look next: views in the order of how well they would tell the samples apart.

        Args:
            poses: (4, 4) camera to world, or to the robot's base if `camera_pose` was given; None:
                views all around the objects.
            count: of those.

        Returns:
            Each with `T_world_camera`, in the same frame as `poses`, and `score`: the share of the
            spread of the samples that the view is expected to remove.

        Raises:
            InputError: what was given are no poses.
        """
        from scenefw.perception.ranking.next_view import next_views_in_base

        require_whole(count, "count", 1)
        given = None if poses is None else [np.asarray(pose, np.float64) for pose in poses]
        return next_views_in_base(self.samples, given, count)

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
        return render(self._sample(sample), camera, turn)

    def _sample(self, number: int) -> SceneEstimate:
        require_whole(number, "sample")
        if number >= len(self.samples):
            raise InputError(
                f"there is no sample {number}; give one of 0 to {len(self.samples) - 1}"
            )
        return self.samples[number]
