import json

import pytest

from scenefw.core.errors import StorageError
from scenefw.evaluation import kept_rows
from scenefw.evaluation.kept_rows import KeptRows, kept_or_made


def items(count=5):
    return {str(i): (i, i) for i in range(count)}


def run(kept, stop_at=None, made=None):
    """Squares; stops like a killed run before one of them."""

    def make(some, done):
        results = []
        for item in some:
            if item[0] == stop_at:
                raise KeyboardInterrupt
            (made if made is not None else []).append(item[0])
            results.append({"square": item[0] ** 2})
            done(item, results[-1])
        return results

    return kept_or_made(kept, items(), make, dict, lambda row: {**row})


@pytest.fixture
def folder(tmp_path):
    (tmp_path / "config.yaml").write_text("a: 1\n")
    record = {"weights": {"w": "0"}, "versions": {"scenefw": "1"}, "command": ["x"]}
    (tmp_path / "run.json").write_text(json.dumps(record))
    return tmp_path


EXPECTED = [{"square": i**2} for i in range(5)]


def test_an_interrupted_run_goes_on(folder, capsys):
    with pytest.raises(KeyboardInterrupt):
        run(KeptRows(folder), stop_at=3)
    made = []
    assert run(KeptRows(folder), made=made) == EXPECTED
    assert made == [3, 4]
    assert "3 finished parts" in capsys.readouterr().err
    assert not (folder / "views.jsonl").exists()  # a finished one starts anew
    made = []
    assert run(KeptRows(folder), made=made) == EXPECTED
    assert len(made) == 5


def test_a_cut_line_is_made_again(folder):
    with pytest.raises(KeyboardInterrupt):
        run(KeptRows(folder), stop_at=3)
    path = folder / "views.jsonl"
    path.write_text(path.read_text()[:-4])
    made = []
    assert run(KeptRows(folder), made=made) == EXPECTED
    assert made == [2, 3, 4]


@pytest.mark.parametrize("changed", ["config.yaml", "run.json"])
def test_rows_of_other_settings_weights_or_versions_are_not_used(folder, changed):
    with pytest.raises(KeyboardInterrupt):
        run(KeptRows(folder), stop_at=3)
    text = (folder / changed).read_text()
    (folder / changed).write_text(text.replace("1", "2"))
    made = []
    assert run(KeptRows(folder), made=made) == EXPECTED
    assert len(made) == 5


def test_the_command_may_differ(folder):
    """As `paths.output` written in another way."""
    with pytest.raises(KeyboardInterrupt):
        run(KeptRows(folder), stop_at=3)
    record = folder / "run.json"
    record.write_text(record.read_text().replace('"x"', '"y"'))
    made = []
    run(KeptRows(folder), made=made)
    assert made == [3, 4]


def test_a_file_that_is_none_of_ours_starts_anew_or_is_one_line(folder):
    (folder / "views.jsonl").write_text("{]\n[1, 2]\n")
    assert run(KeptRows(folder)) == EXPECTED
    (folder / "views.jsonl").write_bytes(b"\xff\xfe\xff")
    with pytest.raises(StorageError, match=r"views\.jsonl"):
        run(KeptRows(folder))


def test_nothing_is_kept_without_a_place():
    assert run(None) == EXPECTED


def test_rows_of_other_code_are_not_used(folder, monkeypatch):
    """A commit says nothing of what was changed since."""
    with pytest.raises(KeyboardInterrupt):
        run(KeptRows(folder), stop_at=3)
    monkeypatch.setattr(kept_rows, "sources", lambda: "edited")
    made = []
    assert run(KeptRows(folder), made=made) == EXPECTED
    assert len(made) == 5
