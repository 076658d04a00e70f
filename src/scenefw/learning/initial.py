"""Starting a training from the weights of an earlier one."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import cast

from torch import Tensor, nn

from scenefw.core.errors import CheckpointError, ConfigError
from scenefw.core.training_protocols import Network
from scenefw.learning.checkpoint import SHAPE_INSTANCE, load_checkpoint


def start_from(
    model: Network,
    path: Path | str,
    task: str = SHAPE_INSTANCE,
    reinitialise: Sequence[str] = (),
) -> None:
    """Gives a network the weights of a checkpoint.

    Children that only training needs (`training_only`) may be missing there, as in the weights that
    ship, and start from random weights. So do the modules named by `reinitialise`, whatever the
    file holds.

    Raises:
        CheckpointError: the file is unusable, for another task, or of other layers.
        ConfigError: the network has no module of a name in `reinitialise`.
    """
    module = cast("nn.Module", model)  # which a protocol can't say
    model_weights = module.state_dict()
    fresh = [*model.training_only, *_checked_modules(reinitialise, model_weights)]
    stored = load_checkpoint(path, task=task).model.state_dict()
    weights = {n: value for n, value in stored.items() if not _within(n, reinitialise)}
    missing_names = [n for n in model_weights if n not in weights and not _within(n, fresh)]
    mismatched_names = [
        n for n in weights if n not in model_weights or model_weights[n].shape != weights[n].shape
    ]
    if missing_names or mismatched_names:
        raise CheckpointError(
            f"{path} holds a different network from the one to train "
            f"({(missing_names + mismatched_names)[0]} and "
            f"{len(missing_names + mismatched_names) - 1} more differ); give the same model and "
            "grid settings"
        )
    module.load_state_dict({**model_weights, **weights})


def _checked_modules(reinitialise: Sequence[str], model_weights: Mapping[str, Tensor]) -> list[str]:
    for name in reinitialise:
        if not any(_within(n, [name]) for n in model_weights):
            raise ConfigError(
                f"learning.reinitialise names {name}, which the network does not have; it has "
                f"{', '.join(sorted({'.'.join(n.split('.')[:2]) for n in model_weights}))}"
            )
    return list(reinitialise)


def _within(name: str, modules: Sequence[str]) -> bool:
    return any(name.startswith(f"{module}.") for module in modules)
