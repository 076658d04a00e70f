import json
import os
import shutil
from pathlib import Path

import pytest

from scenefw.core.errors import StorageError
from scenefw.core.folders import MANIFEST, adding_to_folder, replacing_folder, require_replaceable


def write(folder, **files):
    """Files by stem, in JSON."""
    folder.mkdir(parents=True, exist_ok=True)
    for stem, text in files.items():
        path = folder / f"{stem.replace('__', '/')}.json"
        path.parent.mkdir(exist_ok=True)
        path.write_text(text)


def result(target, **files):
    with replacing_folder(target) as folder:
        write(folder, **files)


def content(folder):
    found = (path for path in folder.rglob("*") if path.is_file() or path.is_symlink())
    return {
        path.relative_to(folder).as_posix(): path.read_text()
        for path in found
        if path.name != MANIFEST
    }


@pytest.fixture
def target(tmp_path):
    return tmp_path / "scan"


def test_what_scenefw_wrote_goes_and_all_else_stays(target):
    result(target, scene="old", object_02="old", hypothesis_2__scene="old")
    (target / "notes.txt").write_text("mine")
    (target / "hypothesis_2" / "notes.txt").write_text("mine too")
    result(target, scene="new")
    result(target, scene="newer")  # what was carried over once is carried over again
    kept = {"notes.txt": "mine", "hypothesis_2/notes.txt": "mine too"}
    assert content(target) == {"scene.json": "newer", **kept}
    assert [one.name for one in target.parent.iterdir()] == ["scan"]


def test_a_folder_of_other_files_is_not_replaced(target):
    write(target, view="mine", scene="mine")
    words = r"scan is no folder of results: it holds other files, such as scene\.json; give"
    with pytest.raises(StorageError, match=words), replacing_folder(target):
        pytest.fail("the work has begun")
    with pytest.raises(StorageError, match=words):
        require_replaceable(target)
    assert content(target) == {"view.json": "mine", "scene.json": "mine"}


@pytest.mark.parametrize("manifest", ["", "[]", '{"files": 3}'])
def test_a_damaged_manifest_lists_nothing(target, manifest):
    result(target, scene="old")
    (target / MANIFEST).write_text(manifest)
    with pytest.raises(StorageError, match=r"such as scene\.json"):
        require_replaceable(target)


def test_a_file_that_was_changed_since_is_not_lost(target):
    result(target, scene="old", other="old")
    (target / "scene.json").write_text("owl")  # of the same size
    with pytest.raises(StorageError, match=r"scan/scene\.json was changed since scenefw wrote it"):
        result(target, scene="new")
    assert content(target) == {"scene.json": "owl", "other.json": "old"}


def test_a_copy_of_a_result_is_replaced_too(target):
    result(target, scene="old")
    copied = shutil.copytree(target, target.with_name("copied"), copy_function=shutil.copyfile)
    result(copied, scene="new")
    assert content(copied) == {"scene.json": "new"}


@pytest.mark.parametrize(("mine", "new"), [("page", "page"), ("page__x", "page"), ("a", "a__b")])
def test_a_file_of_somebody_else_by_the_same_name_is_not_replaced(target, mine, new):
    result(target, scene="old")
    if "__" in mine:
        (target / "page.json").mkdir()
        path = target / "page.json" / "x"
    else:
        path = target / (mine if "__" in new else f"{mine}.json")
    path.write_text("mine")
    before = content(target)
    with pytest.raises(
        StorageError, match=r"was not written by scenefw, but a result of this name"
    ):
        result(target, scene="new", **{new: "new"})
    assert content(target) == before
    assert [one.name for one in target.parent.iterdir()] == ["scan"]


def test_links_stay_and_what_they_name_is_left_alone(target, tmp_path):
    write(tmp_path / "far", precious="mine")
    result(target, scene="old")
    (target / "far").symlink_to(tmp_path / "far")
    (target / "file").symlink_to(tmp_path / "far" / "precious.json")
    (target / "nowhere").symlink_to(tmp_path / "none")
    result(target, scene="new")
    assert (target / "far").is_symlink()
    assert (target / "file").is_symlink()
    assert (target / "nowhere").is_symlink()
    assert content(tmp_path / "far") == {"precious.json": "mine"}
    result(tmp_path / "own", scene="old")
    (tmp_path / "own" / "scene.json").unlink()
    (tmp_path / "own" / "scene.json").symlink_to(tmp_path / "far" / "precious.json")
    with pytest.raises(StorageError, match="was changed since"):
        result(tmp_path / "own", scene="new")


def test_a_folder_behind_a_link_is_replaced_where_it_is(target, tmp_path):
    real = tmp_path / "disk" / "results"
    result(real, scene="old")
    target.symlink_to(real)
    result(target, scene="new")
    assert target.is_symlink()
    assert content(real) == {"scene.json": "new"}
    assert [one.name for one in real.parent.iterdir()] == ["results"]


@pytest.mark.parametrize("name", ["old", "new", "scene.v2"])
def test_writers_see_the_name_of_the_folder(tmp_path, name):
    for _ in range(2):
        with replacing_folder(tmp_path / name) as folder:
            write(folder, scene="{}")
            assert folder.name == name
    assert content(tmp_path / name) == {"scene.json": "{}"}


def test_an_empty_folder_is_replaced(target):
    target.mkdir()
    result(target, scene="{}")
    assert content(target) == {"scene.json": "{}"}


def test_a_file_in_the_place_of_the_folder_is_one_line(target):
    target.write_text("mine")
    with pytest.raises(StorageError, match="scan: Not a directory"):
        require_replaceable(target)


@pytest.mark.parametrize("failure", [OSError("no"), KeyboardInterrupt()])
def test_what_was_there_comes_back_if_the_new_folder_cannot_take_its_place(
    target, monkeypatch, failure
):
    result(target, scene="old")
    (target / "notes.txt").write_text("mine")
    rename = Path.rename

    def failing(self, to):
        if self.parent.name == "new":
            raise failure
        return rename(self, to)

    monkeypatch.setattr(Path, "rename", failing)
    with pytest.raises(StorageError if isinstance(failure, OSError) else KeyboardInterrupt):
        result(target, scene="new")
    assert content(target) == {"scene.json": "old", "notes.txt": "mine"}
    assert [one.name for one in target.parent.iterdir()] == ["scan"]


def test_the_old_folder_is_not_removed_if_it_cannot_be_put_back(target, monkeypatch):
    result(target, scene="old")
    rename = Path.rename

    def failing(self, to):
        if self == target:
            return rename(self, to)
        raise OSError("no")

    monkeypatch.setattr(Path, "rename", failing)
    with pytest.raises(StorageError, match=r"what was there is now .*/old, move it back"):
        result(target, scene="new")
    [kept] = target.parent.glob(".scan.*/old")
    assert content(kept) == {"scene.json": "old"}


def test_files_are_carried_over_without_hard_links(target, monkeypatch):
    result(target, scene="old")
    (target / "notes.txt").write_text("mine")

    def failing(*_, **__):
        raise OSError("no links here")

    monkeypatch.setattr(os, "link", failing)
    result(target, scene="new")
    assert content(target) == {"scene.json": "new", "notes.txt": "mine"}


def test_a_folder_without_a_manifest_appears_but_is_never_replaced(target):
    with replacing_folder(target, listed=False) as folder:
        write(folder, scene="old")
    assert [one.name for one in target.iterdir()] == ["scene.json"]
    with pytest.raises(StorageError, match="is no folder of results"):
        result(target, scene="new")


def test_what_is_added_is_listed_too(target):
    result(target, scene="old")
    for text in ("once", "twice"):
        with adding_to_folder(target) as folder:
            write(folder, grasps=text)
    assert content(target) == {"scene.json": "old", "grasps.json": "twice"}
    assert set(json.loads((target / MANIFEST).read_text())["files"]) == {
        "scene.json",
        "grasps.json",
    }
    result(target, scene="new")
    assert content(target) == {"scene.json": "new"}


def test_what_is_added_replaces_nothing_of_somebody_else(target):
    result(target, scene="old")
    (target / "grasps.json").write_text("mine")
    words = r"grasps\.json was not written by scenefw"
    with pytest.raises(StorageError, match=words), adding_to_folder(target) as folder:
        write(folder, aaa="new", grasps="new")
    assert content(target) == {"scene.json": "old", "grasps.json": "mine"}
