"""A Dask cluster of this machine: same results as a loop, also when a worker is killed."""

import pytest
from plugins.simulators.tests.scattering import Scattering, generated
from plugins.sweeps.tests.work import mortal, square

from scenefw.core.errors import ConfigError
from scenefw.scenes.storage import load_scenes
from scenefw_simulators.generation import statistics
from scenefw_sweeps.dask import Dask

distributed = pytest.importorskip("distributed", reason="needs Dask (pip install 'scenefw[dask]')")


@pytest.fixture(scope="module")
def cluster():
    with distributed.LocalCluster(
        n_workers=2, threads_per_worker=1, dashboard_address=None
    ) as made:
        yield made


def test_results_are_those_of_a_loop(cluster):
    workers = Dask(cluster.scheduler_address)
    expected = [n * n for n in range(7)]
    assert list(workers.each(square, range(7))) == expected
    assert sorted(workers.each(square, range(7), ordered=False)) == expected


def test_work_of_a_killed_worker_is_done_by_others(cluster, tmp_path):
    jobs = [(n, tmp_path / "killed" if n == 3 else None) for n in range(6)]
    found = list(Dask(cluster.scheduler_address).each(mortal, jobs))
    assert (tmp_path / "killed").exists()
    assert found == [n * n for n in range(6)]


class Mortal(Scattering):
    """Scenes whose maker is killed once, in the middle of a shard."""

    def __init__(self, path=None):
        super().__init__()
        self._path = path  # not part of the recipe

    def generate(self, index, seed):
        if index == 10:
            mortal((index, self._path))
        return super().generate(index, seed)


@pytest.mark.exhaustive
def test_a_data_set_survives_a_killed_worker(cluster, tmp_path, monkeypatch):
    monkeypatch.setattr(statistics, "draw", lambda *_: None)
    workers = Dask(cluster.scheduler_address)
    _, killed = generated(tmp_path / "killed", Mortal(tmp_path / "once"), parallel=workers)
    _, whole = generated(tmp_path / "whole", Mortal())
    assert (tmp_path / "once").exists()
    one, two = load_scenes(killed).arrays(), load_scenes(whole).arrays()
    assert all((one[name] == two[name]).all() for name in one)


def test_no_scheduler():
    with pytest.raises(ConfigError, match=r"no Dask scheduler at tcp://127\.0\.0\.1:9"):
        list(Dask("tcp://127.0.0.1:9", timeout=0.5).each(square, [1, 2]))


@pytest.mark.parametrize("wrong", [{"workers": 0}, {"timeout": 0.0}])
def test_bad_settings(wrong):
    with pytest.raises(ConfigError, match=rf"parallel\.{next(iter(wrong))}"):
        Dask(**wrong)
