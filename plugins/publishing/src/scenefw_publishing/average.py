"""Writes weights between those of two trainings of one network."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

from scenefw.core.errors import CheckpointError, ConfigError
from scenefw.core.files import require_writable
from scenefw.core.settings import PROBABILITY
from scenefw.learning.checkpoint import load_checkpoint, save_checkpoint, weights_file
from scenefw.learning.provenance import read_provenance

if TYPE_CHECKING:
    from torch import Tensor, nn


class Average:
    """The mean of the weights of a training and of an earlier one (`run=average`).

    A training on other data makes a network better there, and often worse on what it knew. Weights
    between those before and after keep most of both (Wortsman et al., CVPR 2022, "Robust
    fine-tuning of zero-shot models"). It holds only for trainings that started from each other, or
    from the same weights.

    Args:
        checkpoint: file of the later weights, or the name of weights that come with scenefw or a
            plugin.
        before: likewise of the earlier ones.
        output: the run's folder.
        share: of the later weights in the mean.
        half: store weights as float16.

    Raises:
        ConfigError: one of both isn't given, or a share that isn't between 0 and 1.
    """

    def __init__(
        self,
        checkpoint: str | Path | None,
        before: str | Path | None,
        output: str | Path,
        share: float = 0.5,
        *,
        half: bool = True,
    ) -> None:
        if checkpoint is None or before is None:
            raise ConfigError(
                "a mean needs two weights; give checkpoint=FILE of the later training and "
                "run.before=FILE of the earlier one"
            )
        PROBABILITY.require(share=share)
        self.checkpoint, self.before = checkpoint, before
        self.output, self.share, self.half = Path(output), share, half

    def run(self) -> dict[str, float]:
        """Writes the mean; returns the share, and how far apart both are.

        Raises:
            CheckpointError: weights are missing or damaged, or of two networks.
            StorageError: the file can't be written.
        """
        require_writable(self.output)
        files = [weights_file(checkpoint) for checkpoint in (self.checkpoint, self.before)]
        later, earlier = (read_provenance(file) for file in files)
        model, earlier_model = (load_checkpoint(file, task=later.task).model for file in files)
        if earlier.grid != later.grid or not _same_architecture(model, earlier_model):
            raise CheckpointError(
                f"{files[0]} and {files[1]} are weights of two networks; give those of one, of "
                "which the later training started from the earlier weights"
            )
        distance = _average(model, earlier_model.state_dict(), self.share)
        metadata = {**later.metadata, "averaged_with": self._origin(earlier.path, earlier.digest)}
        target = self.output / files[0].name
        save_checkpoint(
            target,
            model,
            later.recipe,
            later.grid,
            metadata,
            half=self.half,
            omit=later.omitted,
            task=later.task,
        )
        print(target)
        return {"share": self.share, "apart": distance}

    def _origin(self, path: Path, digest: str) -> dict[str, Any]:
        return {"file": path.name, "sha256": digest, "share": 1 - self.share}


def _same_architecture(first: nn.Module, second: nn.Module) -> bool:
    """Whether they have the same weights; recipes may leave out arguments that were added since."""
    shapes = [{name: v.shape for name, v in net.state_dict().items()} for net in (first, second)]
    return type(first) is type(second) and shapes[0] == shapes[1]


def _average(model: nn.Module, earlier_state: dict[str, Tensor], share: float) -> float:
    """Moves weights towards others in place; returns their distance as a share of their length."""
    state = model.state_dict()
    mean_state = {
        name: value.lerp(earlier_state[name], 1 - share) if value.is_floating_point() else value
        for name, value in state.items()
    }
    squared_distance = sum(
        float((value - earlier_state[name]).double().square().sum())
        for name, value in state.items()
        if value.is_floating_point()
    )
    length = sum(float(v.double().square().sum()) for v in state.values() if v.is_floating_point())
    model.load_state_dict(mean_state)
    return float((squared_distance / max(length, 1e-300)) ** 0.5)
