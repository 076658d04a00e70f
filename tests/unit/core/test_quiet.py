"""Silence within a block, whoever writes."""

import os

import pytest

from scenefw.core.quiet import silenced


def test_nothing_is_written_within_and_all_is_after(capfd):
    with silenced():
        os.write(2, b"from compiled code\n")
    os.write(2, b"after\n")
    assert capfd.readouterr().err == "after\n"


def test_an_error_passes_and_ends_the_silence(capfd):
    with pytest.raises(ImportError), silenced():
        raise ImportError("gone")
    os.write(2, b"after\n")
    assert capfd.readouterr().err == "after\n"
