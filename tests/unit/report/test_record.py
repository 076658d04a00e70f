import json

import pytest

from scenefw.report.record import command_line, read_record


@pytest.mark.parametrize(
    ("word", "expected"),
    [
        ("input=/home/me/images", "input=images"),
        ("input=images/mine", "input=images/mine"),
        (
            "run.results=[/tmp/a/metrics.json,b/metrics.json]",
            "'run.results=[metrics.json,b/metrics.json]'",
        ),
        ("report.title=One / two", "'report.title=One / two'"),
        ("/home/me/x", "x"),
        ("trainer=gpu", "trainer=gpu"),
    ],
)
def test_paths_of_one_machine_are_cut(word, expected):
    assert (
        command_line({"command": [word, "paths.output=/tmp/x"]}) == f"python -m scenefw {expected}"
    )


def test_a_run_of_a_sweep_is_named_by_its_own_settings():
    record = {"command": ["-m", "seed=1,2", "run=train"], "overrides": ["seed=2", "run=train"]}
    assert command_line(record) == "python -m scenefw seed=2 run=train"


def test_a_folder_without_a_record(tmp_path):
    assert read_record(tmp_path) == {}
    (tmp_path / "run.json").write_text(json.dumps({"seed": 3}))
    assert read_record(tmp_path) == {"seed": 3}
