"""What states and weights of earlier versions call by another name.

Whoever moves a network's class, or renames an argument, a module or a fact of trainings, adds a
pair here: old name to new; who adds an argument to one, the value that changes nothing. So
trainings go on, and weights are read, after the code has changed.
"""

from collections.abc import Mapping
from typing import Any

CLASSES: dict[str, str] = {
    "scenefw.models.set_flow.SetFlow": "scenefw_scene_prior.network.SetFlow",  # of a plugin
    "scenefw.models.fully_convolutional.FullyConvolutional": (
        "scenefw_single_view_benchmarks.baselines.fully_convolutional.FullyConvolutional"
    ),
    "scenefw.models.sscnet.SSCNet": "scenefw_single_view_benchmarks.baselines.sscnet.SSCNet",
    "scenefw.models.object_shells.ObjectShells": "scenefw_things.shells.network.ObjectShells",
}
"""Dotted names of networks."""
ARGUMENTS: dict[str, str] = {}
"""Arguments of networks, as CLASS.NAME with the class's new dotted name: to a name."""
ADDED: dict[str, Any] = {
    "scenefw.models.part_affinity.PartAffinity.colour": False,
    "scenefw.models.part_affinity.PartAffinity.obstacles": False,
    "scenefw.models.part_affinity.PartAffinity.shown": False,
    "scenefw.models.set_extents.SetExtents.ends": False,
    "scenefw.models.shape_instance_vae.ShapeInstanceVAE.code_width": 0,
    "scenefw.models.shape_instance_vae.ShapeInstanceVAE.prior_share": 0.4,
}
"""Arguments that networks didn't have at first, as CLASS.NAME: the value that changes nothing."""
MODULES: dict[str, str] = {}
"""Modules and weights of networks, dotted, from the network down: `decoder.first`."""
FACTS: dict[str, str] = {}
"""Facts about trainings."""
LOSSES: dict[str, str] = {}
"""Losses of trainings."""


def recipe(stored: Mapping[str, Any]) -> dict[str, Any]:
    """A stored recipe of a network in today's names."""
    target = CLASSES.get(str(stored.get("_target_")), stored.get("_target_"))
    named = {ARGUMENTS.get(f"{target}.{name}", name): value for name, value in stored.items()}
    added = {
        name: value
        for argument, value in ADDED.items()
        for network, _, name in [argument.rpartition(".")]
        if network == target
    }
    return {**added, **named, "_target_": target}


def weight(name: str) -> str:
    """Today's name of a weight."""
    for old, new in MODULES.items():
        if name == old or name.startswith(f"{old}."):
            return new + name[len(old) :]
    return name


def facts(stored: Mapping[str, Any]) -> dict[str, Any]:
    """Stored facts about a training in today's names."""
    named = {FACTS.get(name, name): value for name, value in stored.items()}
    if isinstance(named.get("losses"), Mapping):
        named["losses"] = {LOSSES.get(n, n): value for n, value in named["losses"].items()}
    return named
