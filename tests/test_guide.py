"""The guide to plugins, followed word by word in an empty folder."""

import json
import os
import re
import shlex
from pathlib import Path

import pytest

GUIDE = (Path(__file__).parents[1] / "docs" / "plugins.md").read_text(encoding="utf-8")
FILES = dict(re.findall(r"^`(plugins/\S+)`\n\n```\w+\n(.*?)^```$", GUIDE, re.MULTILINE | re.DOTALL))
COMMANDS = [
    shlex.split(line)
    for block in re.findall(r"^```sh\n(.*?)^```$", GUIDE, re.MULTILINE | re.DOTALL)
    for line in block.splitlines()
]


@pytest.fixture
def followed(tmp_path):
    for name, text in FILES.items():
        (path := tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text)
    return tmp_path


def test_files_and_commands_are_found():
    assert len(FILES) == 13
    assert GUIDE.count("```toml") + GUIDE.count("```yaml") + GUIDE.count("```python") == 13 + 3
    assert [words[:2] for words in COMMANDS] == [["python", "-m"]] * 5


@pytest.mark.exhaustive
def test_the_guide_leads_to_figures_and_a_card(scenefw, warm, followed):
    shown = {}
    for _, _, module, *words in COMMANDS:
        if module == "scenefw":
            done = scenefw(*words, *(["device=cpu"] if "debug=smoke" in words else []))
        else:
            done = warm(module, words, followed, dict(os.environ))
        assert done.returncode == 0, f"{words}: {done.stderr[-3000:]}{done.stdout[-3000:]}"
        shown[" ".join(words)] = done.stdout
    assert "Litres of matter in a partial view" in shown["--list model"]
    outputs = followed / "outputs"
    scored = json.loads((outputs / "scored" / "metrics.json").read_text())
    assert scored["views"] == 2
    assert {"error", "mean/error"} <= scored.keys()
    card = (outputs / "card" / "litres.md").read_text()
    for words in ("to the litres of matter in the grid", "| litres too many or too few (l) ↓ |"):
        assert words in card
    assert "1 passed" in shown["plugins/litres"]
