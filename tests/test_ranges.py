"""Numbers out of range are named before the work, whatever part they are of."""

import pytest
from hydra.errors import InstantiationException
from hydra.utils import instantiate
from plugins.simulators.tests.scattering import Scattering
from tests.composed import base
from tests.unit.learning.plain import Network, task

from scenefw.core.errors import ConfigError
from scenefw.learning.resumable import ResumableModule
from scenefw.learning.runtime.trainer import TrainerSettings
from scenefw.mapping.odometry import RGBDOdometry
from scenefw.scenes.cameras import RandomViewpoints
from scenefw.tasks.train import Train
from scenefw_simulators.generation.stacks import StackGenerator


@pytest.mark.parametrize(
    ("option", "names"),
    [
        ("engine=pybullet", "time_step friction margin solver_iterations quiet_steps check_every"),
        ("engine=mujoco", "time_step substeps gravity damping linear_speed angular_speed"),
        ("shape=superquadrics", "paired seed"),
        ("shape=superquadrics_v1", "paired seed"),
        ("renderer=sphere_tracer", "max_steps tolerance"),
    ],
)
def test_of_a_component(option, names):
    group, _, chosen = option.partition("=")
    settings = base(f"+{group}@component={chosen}").component
    for name in names.split():
        with pytest.raises(InstantiationException) as raised:
            instantiate(settings, **{name: -1})
        assert f"{name} = -1: expected" in str(raised.value.__cause__)


@pytest.mark.parametrize(
    ("component", "names"),
    [
        (RandomViewpoints, "fx fy closest jitter"),
        (RGBDOdometry, "largest_depth largest_difference least_fitness"),
    ],
)
def test_of_settings(component, names):
    for name in names.split():
        with pytest.raises(ConfigError, match=rf"{name} = -1: expected"):
            component(**{name: -1})


@pytest.mark.parametrize(
    "name", ["trials", "max_steps", "density", "check_steps", "checks", "max_shift", "max_turn"]
)
def test_of_stacks(name):
    with pytest.raises(ConfigError, match=rf"^{name} = -1: expected"):
        StackGenerator(Scattering().shapes, None, **{name: -1})


@pytest.mark.parametrize("name", ["validate_every", "gradient_clip", "nodes"])
def test_of_trainers(name):
    with pytest.raises(ConfigError, match=rf"^{name} = -1: expected"):
        TrainerSettings("cpu", **{name: -1})


@pytest.mark.parametrize(
    ("name", "value"), [("learning_rate", 0), ("weight_decay", -1), ("average", -1), ("average", 1)]
)
def test_of_trainings(name, value):
    settings = {"learning_rate": 0.1, "weight_decay": 0.0, "average": 0.9, name: value}
    with pytest.raises(ConfigError, match=rf"^{name} = {value}: expected"):
        ResumableModule(Network(), schedule=None, compile=False, optimizer=None, **settings)


@pytest.mark.parametrize("name", ["snapshot_minutes", "snapshot_steps", "log_every"])
def test_of_runs_that_train(tmp_path, name):
    given = task(tmp_path, 1)
    parts = given.learning, given.data, given.trainer, tmp_path, tmp_path
    with pytest.raises(ConfigError, match=rf"^{name} = -1: expected"):
        Train(*parts, **{name: -1})
