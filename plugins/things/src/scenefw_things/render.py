"""Renders images of scenes of things, as trainings read them."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from scenefw.core import rng as streams
from scenefw.core.errors import ConfigError, InputError
from scenefw.core.files import require_writable, write_text
from scenefw.core.made_of import settings_of
from scenefw.core.settings import COUNT
from scenefw.report.console import track
from scenefw_things.images.renderer import ThingImage, ThingRenderer
from scenefw_things.images.stored_images import DEPTH_UNIT, OBSTACLE, StoredImages
from scenefw_things.images.stored_solids import StoredSolids
from scenefw_things.scenes.cameras import HandheldCameras
from scenefw_things.scenes.scene import OBJECT, ThingScene, load_scenes
from scenefw_things.scenes.scene import OBSTACLE as IS_OBSTACLE

_SAVED_AFTER = 50  # scenes: what a kill costs
_ROUNDS = 3  # of cameras, where walls or robots hide all things
_THING_RADIUS = 0.1  # m: so far things reach from their middle
_VIEWS = 6  # random stream, beside those that make scenes
_SOLIDS = "solids.npz"
_CAMERAS = {"_target_": "scenefw.scenes.things.cameras.HandheldCameras"}
"""What images that trainings have begun with call the cameras: it is compared when they go on."""
_SURFACE_POINTS = {"train": 0, "val": 4000}  # of each thing: distances are validated with them


class RenderThings:
    """Images of the training and validation scenes of a file, in `train` and `val` of a folder.

    Beside them lie the things as solids, `solids.npz`, for networks that complete objects.

    A rerun after a kill goes on where it was; `images.json` in the folder is written last. The
    cameras of scene i depend on (seed, i) alone.

    Args:
        scenes: file of `run=generate_things`.
        cameras: draws them.
        renderer: makes the images.
        views: images of each scene.
        seed: of the cameras.
        folder: where images go.

    Raises:
        ConfigError: fewer than one view, or cameras with images of several sizes.
        InputError: no file.
    """

    def __init__(
        self,
        scenes: str | Path | None,
        cameras: HandheldCameras,
        renderer: ThingRenderer,
        views: int,
        seed: int,
        folder: str | Path,
    ) -> None:
        COUNT.require(views=views)
        if scenes is None:
            raise InputError("no scenes; give input=FILE.npz of run=generate_things")
        self.scenes, self.folder = Path(scenes), Path(folder)
        self.cameras, self.renderer, self.views, self.seed = cameras, renderer, views, seed
        self.size = _only_size(cameras)

    def run(self) -> dict[str, float]:
        """Renders what is missing; returns the numbers of images.

        Raises:
            InputError: the file holds no scenes of a part.
            StorageError: it is damaged, or the folder holds other images.
        """
        require_writable(self.folder)
        scenes = load_scenes(self.scenes)
        facts = {
            "scenes": hashlib.sha256(self.scenes.read_bytes()).hexdigest(),
            "views": self.views,
            "seed": self.seed,
            "cameras": settings_of(self.cameras) | _CAMERAS,
            "max_depth": self.renderer.max_depth,
        }
        counts = {}
        for split in ("train", "val"):
            members = [scene for scene in scenes if scene.split == split]
            if not members:
                raise InputError(f"{self.scenes} holds no scenes of part {split}; make more")
            counts[split] = float(self._render(members, self.folder / split, facts))
            solids = self.folder / split / _SOLIDS
            if not solids.exists():
                StoredSolids.of(track(members, _SOLIDS), _SURFACE_POINTS[split]).save(solids)
        write_text(self.folder / "images.json", json.dumps(facts | counts, indent=2) + "\n")
        print(self.folder)
        return counts

    def _render(self, scenes: Sequence[ThingScene], folder: Path, facts: dict[str, Any]) -> int:
        images = StoredImages.create(folder, len(scenes) * self.views, self.size, facts)
        missing = range(len(images) // self.views, len(scenes))
        for number in track(missing, folder.name):
            for view, image in enumerate(self._images(scenes[number])):
                _store(images, number * self.views + view, image)
            images.facts["images"] = (number + 1) * self.views
            if number % _SAVED_AFTER == 0:
                images.save()
        images.save()
        return len(images)

    def _images(self, scene: ThingScene) -> list[ThingImage]:
        """Images that show a thing, if cameras of some rounds find one."""
        rng = streams.generator(self.seed, _VIEWS, scene.index)
        places = np.array([item.pose.position for item in scene.items if item.role == OBJECT])
        middle = places.mean(axis=0)
        radius = _THING_RADIUS + float(np.median(np.linalg.norm(places - middle, axis=1)))
        images: list[ThingImage] = []
        for _ in range(_ROUNDS):
            cameras = [self.cameras.sample(rng, middle, radius) for _ in range(self.views)]
            images += self.renderer.images(scene, cameras)
            if sum(map(_shows_thing, images)) >= self.views:
                break
        return sorted(images, key=_shows_thing, reverse=True)[: self.views]


def _only_size(cameras: HandheldCameras) -> tuple[int, int]:
    if len(cameras.sizes) != 1:
        raise ConfigError(
            f"run.cameras.sizes = {cameras.sizes}: expected one size, as images are stored together"
        )
    width, height = cameras.sizes[0]
    return width, height


def _shows_thing(image: ThingImage) -> bool:
    return bool((image.classes == OBJECT).any())


def _store(images: StoredImages, row: int, image: ThingImage) -> None:
    owners = np.where(image.classes == OBJECT, image.labels, 0)
    owners = np.where(image.classes == IS_OBSTACLE, OBSTACLE + image.labels, owners)
    camera = image.camera
    images.depth[row] = np.rint(image.depth / DEPTH_UNIT).clip(0, np.iinfo(np.uint16).max)
    images.owners[row] = owners
    images.colour[row] = image.colour
    images.intrinsics[row] = (camera.fx, camera.fy, camera.cx, camera.cy)
    images.poses[row] = camera.T_world_camera
