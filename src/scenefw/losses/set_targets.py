"""What losses of sets have in common: matched predictions, and checks before the work."""

from torch import Tensor

from scenefw.core.batches import ObjectSetPrediction, ObjectSetSetup
from scenefw.core.errors import ConfigError, InputError

_TURNED_ON = {
    "existence": "model.existence=true",
    "centres": "model.centres=true",
    "partial": "model=set_vae",
    "latent": "model=set_vae",
}


def matched_of(prediction: ObjectSetPrediction) -> Tensor:
    """The object (B, N) int64 of each prediction, -1 = none.

    Raises:
        InputError: they are not matched.
    """
    if prediction.matched is None:
        raise InputError("match predictions to objects before the loss (matching.object_sets)")
    return prediction.matched


def require_given(loss: str, name: str, setup: ObjectSetSetup) -> None:
    """Whether the network predicts what a loss compares.

    Raises:
        ConfigError: it doesn't.
    """
    if name not in setup.gives:
        raise ConfigError(
            f"the loss {loss} needs a network that gives its {name}; choose {_TURNED_ON[name]}, or "
            "leave the loss out"
        )
