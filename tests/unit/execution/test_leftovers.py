import json

import pytest

from scenefw.execution.leftovers import FIGURES, RECORD, SETTINGS, Leftovers

RECORDS = (SETTINGS, RECORD, FIGURES)


def write(folder, what):
    for name in RECORDS:
        (folder / name).write_text(json.dumps({"of": what}))


def found(folder):
    return {file.name: file.read_text() for file in folder.iterdir()}


@pytest.mark.parametrize("page", [False, True])
def test_records_of_an_earlier_run_are_put_back(tmp_path, page):
    write(tmp_path, "earlier")
    if page:
        (tmp_path / "page.html").touch()
    kept, before = found(tmp_path), Leftovers(tmp_path)
    write(tmp_path, "later")
    (tmp_path / FIGURES).unlink()
    before.restore()
    assert found(tmp_path) == kept


def test_a_folder_that_was_only_taken_is_removed(tmp_path):
    folder = tmp_path / "run"
    folder.mkdir()
    (folder / RECORD).touch()
    before = Leftovers(folder)
    write(folder, "failed")
    before.restore()
    assert not folder.exists()


@pytest.mark.parametrize("made", ["new", "page.html"])
def test_what_a_failed_run_made_stays_with_its_records(tmp_path, made):
    write(tmp_path, "earlier")
    (tmp_path / "page.html").touch()
    before = Leftovers(tmp_path)
    write(tmp_path, "later")
    (tmp_path / made).unlink(missing_ok=True)
    (tmp_path / made).write_text("made")
    before.restore()
    assert json.loads((tmp_path / RECORD).read_text()) == {"of": "later"}


def test_a_full_disk_hides_no_error_and_halves_no_record(tmp_path, full_disk):
    for name in RECORDS:
        (tmp_path / name).write_text(500 * "a")
    before = Leftovers(tmp_path)
    write(tmp_path, "later")
    later = found(tmp_path)
    with full_disk(100):
        before.restore()
    assert found(tmp_path) == later
