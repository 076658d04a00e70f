"""The final split is shut until opened, and its ledger loses nothing."""

import multiprocessing

import pytest

from scenefw.core.errors import ConfigError, StorageError
from scenefw.core.final_split import Ledger, look, looks, opened


def test_the_final_split_is_shut():
    with pytest.raises(ConfigError, match=r"split=final report\.publish=FILE"):
        look("stacks", "ab")
    assert looks() == {}


def test_what_is_read_while_it_is_open_is_noted():
    with opened() as found:
        look("stacks", "ab")
        look("tables", "cd")
        assert looks() == found == {"stacks": "ab", "tables": "cd"}
    assert looks() == {}
    with pytest.raises(ConfigError):
        look("stacks", "ab")
    with opened() as found:
        assert found == {}


def test_it_is_shut_again_after_an_error():
    with pytest.raises(ZeroDivisionError), opened():
        raise ZeroDivisionError
    with pytest.raises(ConfigError):
        look("stacks", "ab")


def test_entries_come_back_in_order(tmp_path):
    ledger = Ledger(tmp_path / "docs" / "ledger.jsonl")
    assert ledger.entries() == []
    for number in range(3):
        ledger.add({"command": f"evaluate é {number}", "data": {"stacks": "ab"}})
    assert [e["command"] for e in ledger.entries()] == [f"evaluate é {n}" for n in range(3)]
    assert ledger.entries()[0]["data"] == {"stacks": "ab"}


def _add(path, number):
    for i in range(20):
        Ledger(path).add({"from": number, "entry": i, "words": "x" * 500})


def test_runs_at_the_same_time_all_stand_in_it(tmp_path):
    path = tmp_path / "ledger.jsonl"
    context = multiprocessing.get_context("fork")
    processes = [context.Process(target=_add, args=(path, n)) for n in range(4)]
    for process in processes:
        process.start()
    for process in processes:
        process.join()
    found = {(e["from"], e["entry"]) for e in Ledger(path).entries()}
    assert found == {(n, i) for n in range(4) for i in range(20)}


@pytest.mark.parametrize("damage", ['{"a": 1}\n{"b"', '{"a": 1}\nx\n', "[1]\n", b"\xff\n"])
def test_a_damaged_ledger_is_neither_read_nor_continued(tmp_path, damage):
    path = tmp_path / "ledger.jsonl"
    path.write_bytes(damage if isinstance(damage, bytes) else damage.encode())
    before = path.read_bytes()
    for use in (Ledger(path).entries, lambda: Ledger(path).add({"c": 2})):
        with pytest.raises(StorageError, match="restore it") as caught:
            use()
        assert "\n" not in str(caught.value)
    assert path.read_bytes() == before


def test_a_full_disk_leaves_the_ledger_as_it_was(tmp_path, full_disk):
    ledger = Ledger(tmp_path / "ledger.jsonl")
    ledger.add({"a": 1})
    with full_disk(20), pytest.raises(StorageError):
        ledger.add({"b": "x" * 1000})
    assert ledger.entries() == [{"a": 1}]
