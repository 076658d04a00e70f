"""Views of table-top scenes: numbers, splits, sampling, and a cache that never lies."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from scenefw.core.errors import ConfigError, InputError
from scenefw.core.final_split import opened
from scenefw.renderers.mesh_raycaster import MeshRaycaster
from scenefw_tabletops.data.table_scenes import TabletopScenes
from scenefw_tabletops.data.view_cache import ViewCache
from scenefw_tabletops.scenes.desk import DeskGenerator
from scenefw_tabletops.scenes.tabletop import TabletopGenerator
from scenefw_tabletops.shapes.desk.library import DeskModels
from scenefw_tabletops.shapes.tabletop.library import ProceduralModels

GENERATOR = TabletopGenerator(ProceduralModels())


class Counting:
    """A renderer that counts what it renders."""

    def __init__(self, **settings):
        self.inner, self.views, self.maps = MeshRaycaster(**settings), 0, 0

    def fingerprint(self):
        return self.inner.fingerprint()

    def frames(self, geometry, cameras):
        self.views += len(cameras)
        return self.inner.frames(geometry, cameras)

    def height_map(self, geometry, grid):
        self.maps += 1
        return self.inner.height_map(geometry, grid)


def source(renderer=None, **changes):
    chosen = {"split": "test", "size": (40, 30), "vertices": 65, **changes}
    return TabletopScenes(GENERATOR, renderer or Counting(), **chosen)


def equal(first, second):
    return (
        np.array_equal(first.depth, second.depth)
        and np.array_equal(first.colour, second.colour)
        and np.array_equal(first.labels, second.labels)
        and np.array_equal(first.camera.T_world_camera, second.camera.T_world_camera)
        and first.name == second.name
    )


@pytest.mark.parametrize(("split", "count"), [("train", 500), ("validation", 120), ("test", 27)])
def test_the_splits_of_the_thesis(split, count):
    assert len(source(split=split)) == count
    assert len(source(split=split, limit=5)) == 5


def test_splits_share_no_scene():
    numbers = [n for split in ("train", "validation", "test") for n in source(split=split).numbers]
    assert sorted(numbers) == list(range(647))


def test_the_final_split_is_shut_and_has_a_seed_of_its_own():
    tables = DeskGenerator(DeskModels(), scenes=(5, 2, 2, 3), minimum=1, maximum=3)
    final = {"split": "final", "size": (40, 30), "vertices": 65}
    with pytest.raises(ConfigError, match="split=final"):
        TabletopScenes(tables, Counting(), **final)
    with opened() as looks:
        found = [TabletopScenes(tables, Counting(), seed=seed, **final) for seed in (0, 1)]
    assert list(found[0].numbers) == [9, 10, 11]
    assert looks.keys() == {"tabletop_final"}
    assert found[0].camera(0, 0).T_world_camera.tolist() == (
        found[1].camera(0, 0).T_world_camera.tolist()
    )
    shown = TabletopScenes(tables, Counting(), split="test", size=(40, 30))
    assert found[0].seed not in (shown.seed, 0, 1)


def test_val_is_validation():
    assert source(split="val").numbers == source(split="validation").numbers


@given(st.integers(0, 26), st.integers(0, 2000))
def test_cameras_are_within_the_ranges(scene, view):
    camera = source().camera(scene, view)
    pose = camera.T_world_camera
    assert 0.18 <= pose[2, 3] <= 0.40
    assert -pose[2, 2] >= np.cos(np.deg2rad(40)) - 1e-9
    assert np.allclose(pose[:3, :3] @ pose[:3, :3].T, np.eye(3))
    assert np.linalg.det(pose[:3, :3]) == pytest.approx(1)
    looked_at = pose[:3, 3] - pose[:3, 2] * pose[2, 3] / pose[2, 2]
    assert np.abs(looked_at).max() <= 0.5 + 1e-9


def test_four_hundred_views_cover_the_table():
    found = source()
    seen = np.zeros((64, 64), dtype=bool)
    v, u = np.mgrid[:30, :40]
    for view in range(400):
        camera = found.camera(0, view)
        local = np.stack([(u - camera.cx) / camera.fx, (v - camera.cy) / camera.fy,
                          np.ones(u.shape)], axis=-1)  # fmt: skip
        ahead = local @ camera.T_world_camera[:3, :3].T
        eye = camera.T_world_camera[:3, 3]
        place = (eye - ahead * (eye[2] / ahead[..., 2:]))[..., :2]
        cell = np.floor((place + 0.512) / 1.024 * 64).astype(int)
        inside = ((cell >= 0) & (cell < 64)).all(axis=-1)
        seen[tuple(cell[inside].T)] = True
    assert seen.all()


def test_a_view_never_changes():
    found = source()
    together = list(found.frames(2, 12))
    assert all(equal(a, b) for a, b in zip(together[7:9], found.frames(2, 2, start=7), strict=True))
    assert not equal(together[0], together[1])
    assert together[3].name == "tabletop/622/3"
    assert not equal(together[0], next(source(seed=1).frames(2, 1)))
    steps = together[0].depth.astype(np.float64) / 5e-5
    assert np.abs(steps - np.rint(steps)).max() < 2e-3
    assert together[0].depth.min() > 0
    assert together[0].labels.dtype == np.int32


def test_the_cache_returns_what_was_rendered(tmp_path):
    plain, renderer = source(), Counting()
    kept = source(renderer, cache=str(tmp_path))
    for count, start, rendered in ((3, 0, 3), (3, 0, 3), (14, 1, 15), (2, 5, 15)):
        expected, got = plain.frames(0, count, start), kept.frames(0, count, start)
        assert all(equal(a, b) for a, b in zip(expected, got, strict=True))
        assert renderer.views == rendered
    fresh = Counting()
    again = source(fresh, cache=str(tmp_path))
    assert all(equal(a, b) for a, b in zip(plain.frames(0, 9), again.frames(0, 9), strict=True))
    assert fresh.views == 0


def test_the_truth_is_kept(tmp_path):
    renderer = Counting()
    first = source(renderer, cache=str(tmp_path)).truth(1)
    second = source(renderer, cache=str(tmp_path)).truth(1)
    assert renderer.maps == 1
    for name in ("heights", "colour", "labels", "confidence", "variance"):
        assert np.array_equal(getattr(first, name), getattr(second, name))
    assert second.classes == GENERATOR.classes
    assert source(renderer, cache=str(tmp_path), vertices=33).truth(1).heights.shape == (33, 33)


@pytest.mark.parametrize(
    "change", [{"seed": 1}, {"size": (20, 15)}, {"heights": (0.2, 0.4)}, {"angles": (0, 20)}]
)
def test_other_settings_never_meet_old_files(tmp_path, change):
    list(source(cache=str(tmp_path)).frames(0, 1))
    renderer = Counting()
    got = next(source(renderer, cache=str(tmp_path), **change).frames(0, 1))
    assert renderer.views == 1
    assert equal(got, next(source(**change).frames(0, 1)))


def test_other_models_or_renderers_never_meet_old_files(tmp_path):
    list(source(cache=str(tmp_path)).frames(0, 1))
    renderer = Counting(contrast=1.0)
    list(source(renderer, cache=str(tmp_path)).frames(0, 1))
    assert renderer.views == 1
    other = TabletopGenerator(ProceduralModels(seed=5))
    renderer = Counting()
    list(TabletopScenes(other, renderer, "test", size=(40, 30), cache=str(tmp_path)).frames(0, 1))
    assert renderer.views == 1


@pytest.mark.parametrize("damage", [b"", b"PK\x03\x04 half a file", b"x" * 3000])
def test_a_damaged_file_is_rendered_anew(tmp_path, damage):
    expected = list(source(cache=str(tmp_path)).frames(0, 2))
    (file,) = tmp_path.rglob("views_*.npz")
    file.write_bytes(damage or file.read_bytes()[:-500])
    renderer = Counting()
    got = list(source(renderer, cache=str(tmp_path)).frames(0, 2))
    assert renderer.views == 2
    assert all(equal(a, b) for a, b in zip(expected, got, strict=True))


def test_blocks_are_files(tmp_path):
    blocks = list(ViewCache(tmp_path).blocks(range(7, 31)))
    assert blocks == [range(7, 10), range(10, 20), range(20, 30), range(30, 31)]


def test_scenes_and_settings_that_do_not_exist():
    with pytest.raises(InputError, match="scene 27 of 27; give 0 to 26"):
        source().scene(27)
    for changes, said in (
        ({"split": "all"}, "no split 'all'"),
        ({"limit": 0}, "limit = 0"),
        ({"heights": (0.4, 0.2)}, "lowest first"),
        ({"size": (0, 10)}, "width and height"),
    ):
        with pytest.raises(ConfigError, match=said):
            source(**changes)
