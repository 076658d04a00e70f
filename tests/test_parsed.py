"""With files parsed once Hydra composes what it composes by itself."""

import pytest
from omegaconf import OmegaConf, base
from tests import parsed

from scenefw import config, plugins

WORDS = (
    ["experiment=simstack", "debug=smoke"],
    ["experiment=label_maps", "scale=thesis", "run=pack_maps", "parallel.workers=1"],
    ["experiment=view_vs_map", "noise=[kinect,pose]", "hydra.job.name=other"],
)


@pytest.mark.exhaustive
@pytest.mark.parametrize("words", WORDS, ids=lambda words: words[0])
def test_compositions_are_those_of_hydra(monkeypatch, words):
    plugins.activate()
    monkeypatch.setattr(parsed, "_parsed", {})
    first, again = (written(words) for _ in range(2))
    assert parsed._parsed  # Hydra asked
    monkeypatch.setattr(parsed.FileConfigSource, "load_config", parsed.LOAD)
    monkeypatch.setattr(base, "parse", parsed.PARSE)
    assert first == again == written(words)


def written(words):
    settings = config.compose([*words, "paths.output=out"])  # by default it names the second
    return repr(settings) + OmegaConf.to_yaml(settings.run, resolve=True)


def test_a_file_that_has_changed_is_read_again(tmp_path):
    source = parsed.FileConfigSource("test", str(tmp_path))
    (tmp_path / "thing.yaml").write_text("# @package other\na: 1\n")
    first = source.load_config("thing")
    assert (first.config, first.header["package"]) == ({"a": 1}, "other")
    first.config.a = 7  # Hydra takes lists of defaults out of what it gets
    assert source.load_config("thing.yaml").config == {"a": 1}
    (tmp_path / "thing.yaml").write_text("a: 10\n")
    assert source.load_config("thing").config == {"a": 10}
    assert source.load_config("thing").header["package"] is None
    (tmp_path / "thing.yaml").unlink()
    with pytest.raises(Exception, match=r"thing\.yaml"):
        source.load_config("thing")
