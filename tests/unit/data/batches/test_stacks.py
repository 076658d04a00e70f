import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from tests.unit.data.stacks_file import write_stacks

from scenefw.core.errors import ConfigError, InputError, StorageError
from scenefw.data.batches.stacks import SHIPPED, StackScenes, shipped_scenes


@pytest.fixture
def stored(tmp_path):
    path = tmp_path / "stacks.npz"
    return path, write_stacks(path)


@pytest.mark.parametrize(("split", "code"), [("train", 0), ("val", 1), ("test", 2)])
def test_a_split_holds_its_scenes_in_order(stored, split, code):
    path, arrays = stored
    scenes = StackScenes(path, split)
    rows = np.flatnonzero(arrays["split"] == code)
    assert len(scenes) == len(rows)
    np.testing.assert_array_equal(scenes.indices, arrays["index"][rows])
    found = scenes.parameters(list(range(len(rows))))
    np.testing.assert_array_equal(found.positions, arrays["positions"][rows])


def test_parameters_match_the_file(stored):
    path, arrays = stored
    found = StackScenes(path, "all").parameters([7, 3])
    np.testing.assert_array_equal(found.half_axes, arrays["half_axes"][[7, 3]])
    np.testing.assert_array_equal(found.exponents, arrays["exponents"][[7, 3]])
    for row, scene in enumerate([7, 3]):
        assert int(found.present[row].sum()) == arrays["count"][scene]
        for i in range(arrays["count"][scene]):
            w, x, y, z = arrays["quaternions"][scene, i].astype(np.float64)
            expected = Rotation.from_quat([x, y, z, w]).as_matrix()
            np.testing.assert_allclose(found.rotations[row, i], expected, atol=1e-6)


def test_limit_takes_the_first(stored):
    path, _ = stored
    few, all_of_them = StackScenes(path, "train", 3), StackScenes(path, "train")
    assert len(few) == 3
    np.testing.assert_array_equal(few.indices, all_of_them.indices[:3])


def test_empty_slots_are_usable(tmp_path):
    path = tmp_path / "stacks.npz"
    arrays = write_stacks(path)
    arrays["quaternions"][:, -1] = 0
    arrays["count"][:] = 2
    np.savez(path, **arrays)
    found = StackScenes(path, "all").parameters([0])
    assert np.isfinite(found.rotations.numpy()).all()


def test_scenes_stay_on_the_device_that_asked(stored):
    """The meta device has no values: whatever looked at some would fail."""
    path, _ = stored
    scenes = StackScenes(path, "all")
    first, again = (scenes.parameters([7, 3, 3], "meta") for _ in range(2))
    expected = scenes.parameters([7, 3, 3])
    for name in ("half_axes", "exponents", "rotations", "positions", "present"):
        for found in (first, again):
            assert getattr(found, name).device.type == "meta"
            assert getattr(found, name).shape == getattr(expected, name).shape
            assert getattr(found, name).dtype == getattr(expected, name).dtype


def test_objects_are_checked_on_the_way_to_another_device(stored):
    path, arrays = stored
    arrays["exponents"][4, 0] = 0.5
    np.savez(path, **arrays)
    with pytest.raises(InputError, match="exponents"):
        StackScenes(path, "all").parameters([0], "meta")


def test_missing_file_names_the_way_out(tmp_path):
    with pytest.raises(StorageError, match="run=generate"):
        StackScenes(tmp_path / "none.npz")


@pytest.mark.parametrize("keep", [0, 100, 2000])
def test_truncated_file_is_one_line(stored, keep):
    path, _ = stored
    path.write_bytes(path.read_bytes()[:keep])
    with pytest.raises(StorageError, match="damaged") as caught:
        StackScenes(path)
    assert "\n" not in str(caught.value)


def test_foreign_npz_names_what_lacks(tmp_path):
    path = tmp_path / "other.npz"
    np.savez(path, depth=np.zeros((2, 2)))
    with pytest.raises(StorageError, match="half_axes"):
        StackScenes(path)


def test_values_must_be_finite(stored):
    path, arrays = stored
    arrays["positions"][0, 0, 0] = np.nan
    np.savez(path, **arrays)
    with pytest.raises(StorageError, match="positions"):
        StackScenes(path)


def test_unknown_split_and_limit(stored):
    path, _ = stored
    with pytest.raises(ConfigError, match="train, val, test"):
        StackScenes(path, "training")
    with pytest.raises(ConfigError, match="limit"):
        StackScenes(path, "train", 0)


def test_the_shipped_data_set_loads():
    if not shipped_scenes().exists():
        pytest.skip("the data set is not part of this checkout")
    scenes = StackScenes(limit=4)
    assert int(scenes.parameters([0, 1, 2, 3]).present.sum(dim=1).min()) >= 3


def test_several_data_sets_are_put_one_after_the_other(tmp_path):
    few = write_stacks(tmp_path / "few.npz", objects=2)
    many = write_stacks(tmp_path / "many.npz", objects=5)
    scenes = StackScenes([tmp_path / "few.npz", str(tmp_path / "many.npz")], "all")
    count = len(few["count"])
    assert len(scenes) == count + len(many["count"])
    found = scenes.parameters([count - 1, count])
    assert found.half_axes.shape[1] == 5
    assert found.present.sum(dim=1).tolist() == [few["count"][-1], many["count"][0]]
    np.testing.assert_array_equal(found.positions[0, :2], few["positions"][-1])
    np.testing.assert_array_equal(found.positions[1], many["positions"][0])
    np.testing.assert_array_equal(scenes.indices[count:], many["index"])


def test_shipped_scattered_scenes_hold_up_to_eight_objects():
    scenes = StackScenes(["stacks", "scattered"], "test", 3)
    assert len(scenes) == 6
    found = StackScenes("scattered_v1", "test").parameters(list(range(200)))
    counts = found.present.sum(dim=1)
    assert int(counts.min()) == 1
    assert int(counts.max()) == 8


def test_names_of_shipped_data_without_a_version_mean_the_latest():
    for name, file in SHIPPED.items():
        assert shipped_scenes(name).name == file
        assert shipped_scenes(name).is_file()
        if name.endswith("_v2"):
            assert shipped_scenes(name.removesuffix("_v2")) == shipped_scenes(name)
    assert StackScenes().sizes.keys() == {"stacks_v2"}
    assert StackScenes(["stacks", "scattered_v1"]).sizes.keys() == {"stacks_v2", "scattered_v1"}


def test_the_final_part_is_a_file_of_its_own_and_v1_has_none():
    assert shipped_scenes("stacks", "final").name == "superquadric_stacks_v2_final.npz"
    with pytest.raises(ConfigError, match="stacks_v1 has no final part"):
        StackScenes("stacks_v1", "final")
    with pytest.raises(ConfigError, match="no data set heaps ships"):
        shipped_scenes("heaps")
    with pytest.raises(StorageError, match="also by name: stacks_v2"):
        StackScenes("heaps")


def test_sizes_of_files_of_one_name_are_told_apart(tmp_path):
    files = [tmp_path / "a" / "stacks.npz", tmp_path / "b" / "stacks.npz", tmp_path / "other.npz"]
    for number, file in enumerate(files, start=1):
        file.parent.mkdir(exist_ok=True)
        write_stacks(file, 10 * number)
    found = StackScenes([*files, files[2]], "all").sizes
    assert found == {str(files[0]): 10, str(files[1]): 20, "other": 60}
