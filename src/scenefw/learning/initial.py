"""Starting a training from the weights of an earlier one."""

from pathlib import Path

from torch import nn

from scenefw.core.errors import CheckpointError
from scenefw.learning.checkpoint import SHAPE_INSTANCE, load_checkpoint


def start_from(model: nn.Module, path: Path | str, task: str = SHAPE_INSTANCE) -> nn.Module:
    """Gives a network the weights of a checkpoint; returns the network.

    Children that only training needs (`training_only`) may be missing there, as in the weights that
    ship, and start anew.

    Raises:
        CheckpointError: the file is unusable, for another task, or of other layers.
    """
    weights = load_checkpoint(path, task=task).model.state_dict()
    own = model.state_dict()
    optional = getattr(model, "training_only", ())
    missing = [n for n in own if n not in weights and n.split(".")[0] not in optional]
    other = [n for n in weights if n not in own or own[n].shape != weights[n].shape]
    if missing or other:
        raise CheckpointError(
            f"{path} holds another network than the one to train ({(missing + other)[0]} and "
            f"{len(missing + other) - 1} more differ); give the same model and grid settings"
        )
    model.load_state_dict({**own, **weights})
    return model
