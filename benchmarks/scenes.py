"""Stacks per second on one core: rest detection against always simulating 1000 steps."""

from benchmarks.harness import Job, Timed
from scenefw_simulators.engines.pybullet_engine import PyBulletEngine
from scenefw_simulators.generation.library import SuperquadricLibrary
from scenefw_simulators.generation.stacks import StackGenerator

ATTEMPTS = 10


class AlwaysThousand(StackGenerator):
    """The same generator with the drops of algorithm 1: 1000 steps, then a look at the result."""

    engine: PyBulletEngine

    def _drop(self, handle: int, handles: list[int]) -> bool:
        self.engine.simulate(self.max_steps)
        at_rest = self.engine.settle(self.engine.quiet_steps)
        return at_rest and all(self._inside(other) for other in handles)


def _stacks(kind: type[StackGenerator]) -> Timed:
    source = kind(SuperquadricLibrary(), PyBulletEngine())

    def run() -> list[object]:
        return [source.generate(index, 0) for index in range(ATTEMPTS)]

    run()  # collision hulls of the shapes are made once
    return run


JOBS = [
    Job(
        f"{ATTEMPTS} stacks of 3 or 4 objects (one core)",
        lambda: _stacks(StackGenerator),
        {"always 1000 steps per drop": lambda: _stacks(AlwaysThousand)},
        repeats=5,
        seconds=20,
    )
]
