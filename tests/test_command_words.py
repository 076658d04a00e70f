"""What people type, brought into the grammar of Hydra."""

import pytest
from hydra.core.override_parser.overrides_parser import OverridesParser

from scenefw.command_words import with_flags_first, with_homes
from scenefw.core.errors import ConfigError


@pytest.fixture(autouse=True)
def home(monkeypatch, tmp_path):
    folder = tmp_path / "it's mine (1)"
    monkeypatch.setenv("HOME", str(folder))
    return str(folder)


@pytest.mark.parametrize("word", ["input=~/a b.png", "input='~/a b.png'", '+input="~/a b.png"'])
def test_the_home_is_put_in_and_parses(word, home):
    (word,) = with_homes([word])
    assert OverridesParser.create().parse_override(word).value() == f"{home}/a b.png"


def test_homes_in_lists_and_sweeps_are_put_in(home):
    listed, sweep = with_homes(["run.results=[~/a,b,~/c]", "input=~/a,~/b"])
    parser = OverridesParser.create()
    assert parser.parse_override(listed).value() == [f"{home}/a", "b", f"{home}/c"]
    values = parser.parse_override(sweep).sweep_string_iterator()
    assert [value.replace("\\'", "'").strip("'") for value in values] == [f"{home}/a", f"{home}/b"]


@pytest.mark.parametrize("word", ["~loss", "~loss=votes", "input=a~b", "input=$HOME/a", "-m", "~"])
def test_other_words_stay(word):
    assert with_homes([word]) == [word]


def test_a_user_who_is_not_there_is_told():
    with pytest.raises(ConfigError, match="~no_such_user_here"):
        with_homes(["input=~no_such_user_here/a.png"])


@pytest.mark.parametrize(
    ("words", "expected"),
    [
        (["a=1", "--multirun", "b=1,2"], ["--multirun", "a=1", "b=1,2"]),
        (["a=1", "--cfg", "job", "b=2", "-p", "run"], ["--cfg", "job", "-p", "run", "a=1", "b=2"]),
        (["-m", "a=1", "~b"], ["-m", "a=1", "~b"]),
        ([], []),
    ],
)
def test_flags_may_stand_anywhere(words, expected):
    assert with_flags_first(words) == expected


@pytest.mark.parametrize("words", [["a=1", "--cfg"], ["--cfg", "nothing"], ["a=1", "--no-such"]])
def test_flags_that_are_wrong_are_one_line(words, capsys):
    with pytest.raises(ConfigError, match="--help"):
        with_flags_first(words)
    assert not "".join(capsys.readouterr())
