import numpy as np
from PIL import Image

from scenefw.core.geometry import look_at, rigid
from scenefw.core.types import Camera
from scenefw.report.palette import instance_colours
from scenefw.shapes.superquadric import Superquadric
from scenefw_grasping.grasps import Film
from scenefw_grasping.report.films import film_camera, film_picture, film_pictures, save_film

CAMERA = Camera(60, 45, 60, 60, 29.5, 22, look_at((0, -0.8, 0.5), (0, 0, 0.05)))


def film():
    """Object 2 rises beside a part of the robot that stays."""
    mesh = Superquadric([0.05] * 3, [20.0] * 3).mesh(6)
    poses = [
        [rigid(np.eye(3), (-0.2, 0, 0.05)), rigid(np.eye(3), (0.1, 0, 0.05 + 0.05 * i))]
        for i in range(3)
    ]
    return Film((mesh, mesh), (0, 2), np.array(poses), 0.1)


def place(picture, colour):
    """Mean row of pixels that look like a colour, in any light."""
    tint = picture / np.maximum(picture.sum(axis=2, keepdims=True), 1e-6)
    near = np.abs(tint - np.array(colour) / sum(colour)).max(axis=2) < 0.08
    return np.argwhere(near).mean(axis=0), near.sum()


def test_a_picture_shows_objects_in_their_colour_where_they_are():
    colour = instance_colours(2)[1]
    (low, many), (high, _) = (place(film_picture(film(), i, CAMERA), colour) for i in (0, 2))
    assert many > 20
    assert low[1] > 30  # right of the middle
    assert high[0] < low[0] - 3
    picture = film_picture(film(), 0, CAMERA)
    assert picture.shape == (45, 60, 3)
    assert picture.min() >= 0
    assert picture[:3].min() > 0.95  # the floor fades into white


def test_the_camera_goes_round_an_arm_that_hides_the_object():
    free = film_camera([film()], CAMERA)
    assert free.T_world_camera[1, 3] < -0.2
    assert abs(free.T_world_camera[0, 3] - 0.1) < 0.1  # on the given camera's side
    block = Superquadric([0.3, 0.01, 0.3], [20.0] * 3).mesh(6)
    poses = film().poses.copy()
    poses[:, 0] = rigid(np.eye(3), (0.1, -0.15, 0.2))
    blocked = Film((block, film().meshes[1]), (0, 2), poses, 0.1)
    colour = instance_colours(2)[1]
    for number in (0, 2):
        assert place(film_picture(blocked, number, film_camera([blocked], CAMERA)), colour)[1] > 500
    assert place(film_picture(blocked, 0, free), colour)[1] < 50


def test_films_are_written_as_gif(tmp_path):
    short = Film(film().meshes, film().labels, film().poses[:1], 0.1)
    pictures = film_pictures([film(), short], ["one", "two"], CAMERA)
    assert len(pictures) == 3
    save_film(tmp_path / "a.gif", pictures, 0.1)
    with Image.open(tmp_path / "a.gif") as made:
        assert made.n_frames == 3
        assert made.size == pictures[0].shape[1::-1]
        assert made.info["loop"] == 0
