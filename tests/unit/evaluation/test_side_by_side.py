import threading

import numba
import pytest
import torch

from scenefw.core.types import GridSpec
from scenefw.data.batches.stacks import StackScenes
from scenefw.evaluation.side_by_side import side_by_side
from scenefw.representations.volumes import scene_volumes


def shown(items, what):
    return items


@pytest.fixture
def threads():
    """Two of torch, and a loop of numba has run, so that it is known which pool it has."""
    scene_volumes(StackScenes(split="test", limit=1).parameters([0]), GridSpec(resolution=8))
    before = torch.get_num_threads()
    torch.set_num_threads(2)
    yield
    torch.set_num_threads(before)


def work_of(meeting):
    def work(item):
        if item:  # the first one is worked on alone
            meeting.wait(20)  # passes when two are at work at once
        return item, threading.get_ident(), torch.get_num_threads(), numba.get_num_threads()

    return work


def test_items_are_worked_on_at_once_with_one_thread_each(threads):
    if numba.threading_layer() == "workqueue":
        pytest.skip("this pool of numba serves one thread at a time")
    found = side_by_side(work_of(threading.Barrier(2)), range(5), shown, "items")
    assert [item for item, *_ in found] == [0, 1, 2, 3, 4]
    assert found[0][1] == threading.get_ident()
    assert {each[2:] for each in found} == {(1, 1)}
    assert torch.get_num_threads() == 2


def test_one_worker_is_a_plain_loop(threads):
    found = side_by_side(work_of(threading.Barrier(1)), range(3), shown, "items", workers=1)
    assert {each[1:3] for each in found} == {(threading.get_ident(), 2)}


def test_progress_is_shown_item_by_item(threads):
    seen = []

    def track(items, what):
        for item in items:
            yield item
            seen.append((what, item))

    side_by_side(lambda item: item, range(3), track, "views", workers=2)
    assert seen == [("views", 0), ("views", 1), ("views", 2)]


def test_an_error_ends_the_work_and_leaves_the_threads_as_they_were(threads):
    def work(item):
        return 1 // (2 - item)

    with pytest.raises(ZeroDivisionError):
        side_by_side(work, range(30), shown, "items")
    assert torch.get_num_threads() == 2
