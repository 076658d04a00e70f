"""Scene files: round trip, order, split, and what is wrong with damaged ones."""

import json
from dataclasses import replace

import numpy as np
import pytest
from tests.unit.data import damaged

from scenefw.core.errors import StorageError
from scenefw.core.geometry import random_quaternion
from scenefw.core.types import Pose, Scene, SceneObject
from scenefw.scenes import storage
from scenefw.scenes.splits import SPLITS
from scenefw_simulators.generation.library import SuperquadricLibrary


def scenes(count, seed=0, most=4):
    library, rng, made = SuperquadricLibrary(size=20), np.random.default_rng(seed), []
    for index in range(count):
        objects = []
        for _ in range(int(rng.integers(1, most + 1))):
            pose = Pose(
                rng.normal(size=3).astype(np.float32).astype(float),
                random_quaternion(rng).astype(np.float32).astype(float),
            )
            objects.append(SceneObject(library.sample(rng), pose, float(np.float32(rng.random()))))
        made.append(Scene(tuple(objects), index, seed))
    return made


def test_round_trip(tmp_path):
    made = scenes(6)
    path = storage.save_scenes(tmp_path / "a.npz", storage.pack(made), {"seed": 0})
    stored = storage.load_scenes(path)
    assert len(stored) == 6
    for row, scene in enumerate(made):
        found = stored.scene(row)
        assert (found.index, len(found.objects)) == (scene.index, len(scene.objects))
        for a, b in zip(found.objects, scene.objects, strict=True):
            np.testing.assert_array_equal(a.shape.half_axes, b.shape.half_axes)
            np.testing.assert_array_equal(a.shape.exponents, b.shape.exponents)
            np.testing.assert_array_equal(a.pose.position, b.pose.position)
            np.testing.assert_array_equal(a.pose.quaternion, b.pose.quaternion)
            assert a.mass == b.mass


def test_layout():
    stored = storage.pack(scenes(5))
    dtypes = {name: (str(a.dtype), a.shape[2:]) for name, a in stored.arrays().items()}
    assert dtypes == {
        "half_axes": ("float32", (3,)),
        "exponents": ("float32", (3,)),
        "positions": ("float32", (3,)),
        "quaternions": ("float32", (4,)),
        "masses": ("float32", ()),
        "count": ("uint8", ()),
        "index": ("int32", ()),
        "split": ("uint8", ()),
    }
    np.testing.assert_allclose(np.linalg.norm(stored.quaternions, axis=-1), 1, atol=1e-6)
    assert (stored.half_axes > 0).all()


def test_concatenate_orders_by_index_and_widens():
    few, many = scenes(3, most=1), scenes(5, most=4)[3:]
    merged = storage.concatenate([storage.pack(many), storage.pack(few)])
    np.testing.assert_array_equal(merged.index, np.arange(5))
    np.testing.assert_array_equal(merged.count[:3], 1)
    np.testing.assert_array_equal(merged.half_axes[3:], storage.pack(many).half_axes)


def test_manifest(tmp_path):
    path = storage.save_scenes(tmp_path / "a.npz", storage.pack(scenes(6)), {"seed": 0})
    manifest = storage.load_manifest(path)
    assert manifest["scenes"] == 6
    assert manifest["seed"] == 0
    assert sum(manifest["objects"].values()) == sum(manifest["split"].values()) == 6


def test_the_manifest_counts_shapes_by_part(tmp_path):
    first, *others = scenes(6)
    made = [replace(first, split="train"), *(replace(scene, split="final") for scene in others)]
    stored = storage.pack(made)
    assert stored.split.tolist() == [0, 3, 3, 3, 3, 3]

    def shapes(some):
        every = (item.shape for scene in some for item in scene.objects)
        return {(*shape.half_axes, *shape.exponents) for shape in every}

    path = storage.save_scenes(tmp_path / "a.npz", stored, {})
    assert storage.load_manifest(path)["shapes"] == {
        "train": len(shapes([first])),
        "val": 0,
        "test": 0,
        "final": len(shapes(others)),
        "shared": len(shapes([first]) & shapes(others)),
    }
    assert shapes([first]) & shapes(others)


def test_files_of_format_1_are_read_as_before(tmp_path):
    path = storage.save_scenes(tmp_path / "a.npz", storage.pack(scenes(3)), {})
    manifest = json.loads(path.with_suffix(".json").read_text())
    del manifest["shapes"]
    path.with_suffix(".json").write_text(json.dumps(manifest | {"format": 1}))
    assert len(storage.load_scenes(path)) == 3


def test_empty_set(tmp_path):
    path = storage.save_scenes(tmp_path / "a.npz", storage.pack([]), {})
    assert len(storage.load_scenes(path)) == 0
    assert len(storage.concatenate([])) == 0


def test_missing(tmp_path):
    with pytest.raises(StorageError, match="run=generate"):
        storage.load_scenes(tmp_path / "none.npz")


@pytest.mark.parametrize("keep", [0, 10, 300, -30])
def test_truncated(tmp_path, keep):
    path = storage.save_scenes(tmp_path / "a.npz", storage.pack(scenes(6)), {})
    path.write_bytes(path.read_bytes()[:keep])
    with pytest.raises(StorageError, match="damaged") as caught:
        storage.load_scenes(path)
    assert "\n" not in str(caught.value)


def test_flipped_bytes(tmp_path):
    path = storage.save_scenes(tmp_path / "a.npz", storage.pack(scenes(6)), {})
    for at in range(40, path.stat().st_size - 40, 97):
        data = bytearray(path.read_bytes())
        data[at] ^= 0xFF
        broken = tmp_path / "b.npz"
        broken.write_bytes(data)
        (tmp_path / "b.json").write_text(path.with_suffix(".json").read_text())
        try:
            found = storage.load_scenes(broken)
        except StorageError:
            continue
        whole = storage.load_scenes(path)  # a byte that means nothing, such as a date
        for name, array in found.arrays().items():
            np.testing.assert_array_equal(array, whole.arrays()[name])


def test_other_contents(tmp_path):
    np.savez(tmp_path / "a.npz", depth=np.zeros((3, 3)))
    with pytest.raises(StorageError, match="holds no scenes"):
        storage.load_scenes(tmp_path / "a.npz")


def test_wrong_shapes(tmp_path):
    arrays = storage.pack(scenes(6)).arrays()
    arrays["positions"] = arrays["positions"][..., :2]
    np.savez(tmp_path / "a.npz", **arrays)
    with pytest.raises(StorageError, match="positions"):
        storage.load_scenes(tmp_path / "a.npz")


def test_arrays_of_another_manifest(tmp_path):
    path = storage.save_scenes(tmp_path / "a.npz", storage.pack(scenes(6)), {})
    np.savez(path, **storage.pack(scenes(6, seed=1)).arrays())
    with pytest.raises(StorageError, match=r"is not what a\.json says"):
        storage.load_scenes(path)


def test_another_format(tmp_path):
    path = storage.save_scenes(tmp_path / "a.npz", storage.pack(scenes(2)), {})
    manifest = json.loads(path.with_suffix(".json").read_text())
    path.with_suffix(".json").write_text(json.dumps(manifest | {"format": 99}))
    with pytest.raises(StorageError, match="format 99"):
        storage.load_scenes(path)


def test_shapes_of_another_kind_are_refused():
    item = scenes(1)[0].objects[0]
    with pytest.raises(StorageError, match="superquadrics alone"):
        storage.pack([Scene((SceneObject(object(), item.pose, 1.0),))])


@pytest.mark.parametrize("kind", damaged.KINDS)
def test_damaged_archives_are_one_line(tmp_path, kind):
    content = storage.pack(scenes(2)).arrays()
    path = damaged.write(tmp_path / "a.npz", kind, content)
    with pytest.raises(StorageError, match="damaged") as caught:
        storage.load_scenes(path)
    assert "\n" not in str(caught.value)


def test_scenes_that_are_packed_again_stay_in_their_split():
    made = [replace(scene, split=SPLITS[i % 4]) for i, scene in enumerate(scenes(8))]
    stored = storage.pack(made)
    again = storage.pack([stored.scene(row, seed=77) for row in range(8)])
    np.testing.assert_array_equal(again.split, stored.split)
    assert len(set(stored.split.tolist())) == 4
