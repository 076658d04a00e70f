"""The final split as a user meets it: shut, but for a release that counts itself."""

import json

import pytest

EVALUATE = ("experiment=simstack", "run=evaluate", "debug=smoke", "gallery=null")


def test_a_release_is_counted(scenefw, tmp_path):
    page = tmp_path / "docs" / "results" / "final.md"
    out = f"paths.output={tmp_path / 'out'}"
    others = ("zero_code", "hull_filling", "partial_tsdf")
    alone = (*[f"~evaluation.methods.{name}" for name in others], "evaluation.draws=null")
    done = scenefw(*EVALUATE, *alone, "split=final", "report.publish=docs/results/final.md", out)
    assert done.returncode == 0, done.stderr[-3000:]
    (line,) = (page.parent / "final_split.jsonl").read_text().splitlines()
    entry = json.loads(line)
    assert entry["data"].keys() == {"superquadric_stacks_v2_final"}
    names = {"simstack", "set_extents", "part_affinity", "object_shells"}
    assert entry["weights"].keys() == {f"{name}.safetensors" for name in names}
    assert "split=final" in entry["command"]
    assert "had been evaluated once by then ([all](final_split.jsonl))" in page.read_text()


@pytest.mark.parametrize(
    ("words", "complaint"),
    [
        (("split=final",), "give report.publish=FILE"),
        (("evaluation.scenes.split=final",), "is for releases"),
        (("split=final", "report.publish=a.md", "run=pipeline"), "only run=evaluate may read it"),
    ],
)
def test_other_looks_are_refused(scenefw, tmp_path, words, complaint):
    done = scenefw(*EVALUATE, *words, "paths.output=out")
    assert done.returncode == 2
    assert complaint in done.stderr
    assert not list(tmp_path.rglob("*.jsonl"))
