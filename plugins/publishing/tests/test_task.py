from types import SimpleNamespace

import pytest

from scenefw.core.errors import ConfigError
from scenefw_publishing.task import Publish


def test_pictures_are_made_where_there_are_images_alone(tmp_path):
    (tmp_path / "README.md").write_text("# Title\n")
    pictures = SimpleNamespace(run=lambda: {"boxes/objects": 3.0})
    published = Publish([], {}, lambda: pictures, tmp_path, tmp_path / "README.md").run()
    assert published == {"boxes/objects": 3.0}
    assert (tmp_path / "README.md").read_text() == "# Title\n"


def test_without_runs_and_images_there_is_nothing_to_publish():
    with pytest.raises(ConfigError, match="nothing to publish"):
        Publish([], {}, lambda: pytest.fail("built"))


def test_command_line_makes_pictures_of_the_input(scenefw, tmp_path):
    (tmp_path / "README.md").write_text("<!-- pictures -->\n<!-- /pictures -->\n")
    (tmp_path / "images").mkdir()
    done = scenefw("run=publish", "input=images", "paths.output=out", "device=cpu")
    assert done.returncode == 2
    assert "no image" in done.stderr
