"""Proposes grasps for the objects of depth images, the least disturbing first."""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from scenefw.core.files import write_text
from scenefw.core.folders import adding_to_folder
from scenefw.core.geometry import inverse
from scenefw.core.types import Float64, Pose, SceneEstimate
from scenefw.core.versions import versions
from scenefw.export.summary import plain
from scenefw.perception.estimate.base_frame import FLOOR_IN_BASE, floor_pose, in_base
from scenefw.report.pictures import save_picture
from scenefw.report.tables import Table, to_console
from scenefw.tasks.predict import Predict
from scenefw.tasks.several_images import finished
from scenefw_grasping.grasps import RankedGrasp, Ranking
from scenefw_grasping.protocols import Grasping
from scenefw_grasping.report.films import film_pictures, save_film
from scenefw_grasping.report.pictures import draw_ranking, grasp_table
from scenefw_simulators.body_maker import BodyMaker

_UP = np.array([0.0, 0.0, 1.0])


class Grasp:
    """Predicts the objects of each image, and ranks grasps of them (thesis 5.5).

    The folder of an image holds what `run=predict` writes, and `grasps.json`, `grasps.png` and a
    film of the first grasp, `grasp.gif`. Where no object can be grasped, the list is empty and says
    why.

    Args:
        predict: reads and predicts images.
        grasping: proposes grasps and simulates them.
        bodies: makes rigid bodies of the objects.
        film: also write the film.
    """

    def __init__(
        self, predict: Predict, grasping: Grasping, bodies: BodyMaker, *, film: bool = True
    ) -> None:
        self.predict, self.grasping, self.bodies, self.film = predict, grasping, bodies, film

    def run(self) -> dict[str, float]:
        """Grasps all images; returns how many, how many failed, and grasps per image.

        Raises:
            InputError: there is no image, or none is usable.
            IncompleteError: some are unusable.
            StorageError: the output folder can't be written.
        """
        grasps = 0

        def work(image: Path, folder: Path) -> None:
            nonlocal grasps
            grasps += len(self.grasp(self.predict.predict(image, folder), folder).grasps)

        count, failures = self.predict.for_each(work)
        figures = {"grasps_per_image": grasps / (count - len(failures))}
        return finished(figures, failures, count)

    def grasp(self, estimate: SceneEstimate, folder: Path) -> Ranking:
        """Ranks the grasps of a predicted scene and writes them into the folder of its image.

        Raises:
            StorageError: the folder can't be written.
        """
        ranking = rank(estimate, self.grasping, self.bodies)
        _print(grasp_table(ranking))
        if not ranking.grasps:
            print(f"{estimate.frame.name}: no grasp: {_reason(ranking)}")
        text = json.dumps(summarise_grasps(estimate, ranking), indent=2, allow_nan=False)
        with adding_to_folder(folder) as temporary:
            write_text(temporary / "grasps.json", text + "\n")
            save_picture(draw_ranking(estimate, ranking), temporary / "grasps.png")
            if self.film and ranking.grasps:
                self._film(estimate, ranking, temporary / "grasp.gif")
        print(folder / "grasps.json")
        return ranking

    def _film(self, estimate: SceneEstimate, ranking: Ranking, path: Path) -> None:
        lift = self.grasping.lift(ranking.resting, ranking.grasps[0].rehearsed, film=True)
        if lift.film is None:
            return
        title = f"first grasp, predicted: others move {1000 * lift.disturbance:.1f} mm"
        pictures = film_pictures([lift.film], [title], estimate.frame.camera)
        save_film(path, pictures, lift.film.seconds)


def rank(estimate: SceneEstimate, grasping: Grasping, bodies: BodyMaker) -> Ranking:
    """The grasps of a predicted scene, the least disturbing first.

    Args:
        estimate: the scene.
        grasping: proposes grasps and simulates them.
        bodies: makes rigid bodies of the objects.
    """
    meshes = {item.id: item.mesh for item in estimate.objects}
    placed = {item.id: item.placed for item in estimate.objects if item.placed is not None}
    scene_bodies = bodies.make(meshes, placed)
    eye = np.array(estimate.frame.camera.T_world_camera[:3, 3])
    ranking = grasping.rank(
        scene_bodies.bodies, eye, [obstacle.mesh for obstacle in estimate.obstacles]
    )
    return Ranking(ranking.grasps, {**scene_bodies.left_out, **ranking.left_out}, ranking.resting)


def summarise_grasps(estimate: SceneEstimate, ranking: Ranking) -> dict[str, Any]:
    """Plain data of ranked grasps: metres, poses of the cup in both frames.

    A pose's z axis points into the surface, its origin is the contact, `quaternion` is
    (w, x, y, z). `floor` is the frame of `scene.json` (z up, floor z = 0), `camera` that of the
    image (x right, y down, z forward), `base` that of the robot where the camera's pose in it is
    known.
    """
    camera = np.array(estimate.frame.camera.T_world_camera)
    base = in_base(estimate)
    is_in_base = base is not estimate
    to_base = floor_pose(base.details) if is_in_base else None
    return {
        "name": estimate.frame.name,
        "grasps": [
            _grasp(i, ranked_grasp, camera, to_base)
            for i, ranked_grasp in enumerate(ranking.grasps, start=1)
        ],
        "without_grasp": [{"id": i, "reason": why} for i, why in ranking.left_out.items()],
        "reason": None if ranking.grasps else _reason(ranking),
        "T_floor_camera": plain(camera),
        **({FLOOR_IN_BASE: plain(to_base)} if is_in_base else {}),
        "versions": versions(),
    }


def _grasp(
    rank: int, ranked_grasp: RankedGrasp, camera: Float64, to_base: Float64 | None
) -> dict[str, Any]:
    grasp, to_camera = ranked_grasp.grasp, inverse(camera)
    directions = [grasp.normal, _UP] if grasp.outward else [_UP]
    frames = {"floor": np.eye(4), "camera": to_camera}
    if to_base is not None:
        frames["base"] = to_base
    return {
        "rank": rank,
        "object": int(grasp.label),
        "disturbance": ranked_grasp.lift.disturbance,
        "moved": [{"id": i, "metres": shift} for i, shift in ranked_grasp.lift.shifts.items()],
        "lifted": ranked_grasp.lift.lifted,
        "failure": ranked_grasp.lift.failure or None,
        "seal": grasp.seal,
        "seen": grasp.seen,
        **{
            name: _pose(motion @ grasp.pose, [motion[:3, :3] @ along for along in directions])
            for name, motion in frames.items()
        },
    }


def _pose(matrix: Float64, directions: Sequence[Float64]) -> dict[str, Any]:
    pose = Pose.from_matrix(matrix)
    return {
        "position": plain(pose.position),
        "quaternion": plain(pose.quaternion),
        "taken_along": [plain(direction) for direction in directions],
    }


def _reason(ranking: Ranking) -> str:
    if not ranking.left_out:
        return "no object was found"
    return "; ".join(f"object {label}: {why}" for label, why in ranking.left_out.items())


def _print(table: Table) -> None:
    from rich.console import Console

    console = Console()
    if not console.is_terminal:
        console = Console(width=160)
    console.print(to_console(table))
