"""Cross entropy of labels per pixel."""

from collections.abc import Sequence

import torch
from torch import Tensor
from torch.nn import functional

from scenefw.core.batches import SegmentationBatch, SegmentationSetup
from scenefw.core.errors import ConfigError
from scenefw.core.labels import UNKNOWN
from scenefw.core.settings import NOT_NEGATIVE, below


class CrossEntropy:
    """Mean cross entropy over the pixels whose class is known (thesis 4.7.1, 4.5.4).

    Args:
        weight: factor of this term in the total.
        class_weights: what a pixel of each class counts, by class id, e.g. less for the surface,
            which covers most; None: all count the same, as in the thesis.
        smoothing: share of the truth spread evenly over the classes, which keeps the network's
            probabilities from 0 and 1.
    """

    needs_draws = False

    def __init__(
        self,
        weight: float = 1.0,
        class_weights: Sequence[float] | None = None,
        smoothing: float = 0.0,
    ) -> None:
        below(1).require(smoothing=smoothing)
        NOT_NEGATIVE.require(class_weights=class_weights)
        self.weight = weight
        self.class_weights = list(class_weights) if class_weights else None
        self.smoothing = smoothing
        self._on_device: Tensor | None = None

    def check(self, setup: SegmentationSetup) -> None:
        """Checks that these classes fit.

        Raises:
            ConfigError: there is another number of class weights.
        """
        self._require_weights(len(setup.classes))

    def _require_weights(self, classes: int) -> None:
        if self.class_weights is not None and len(self.class_weights) != classes:
            raise ConfigError(
                f"loss.cross_entropy.class_weights has {len(self.class_weights)} numbers, but "
                f"there are {classes} classes; give one for each"
            )

    def __call__(self, prediction: Tensor, batch: SegmentationBatch) -> Tensor:
        """A scalar of logits (B, C, H, W): the weighted mean; 0 if no pixel counts.

        Raises:
            ConfigError: there are not as many class weights as classes.
        """
        logits, labels = prediction.float(), batch.labels
        self._require_weights(logits.shape[1])
        weights, valid = self._weights(logits.device), labels != UNKNOWN
        total = functional.cross_entropy(
            logits,
            labels,
            weights,
            ignore_index=UNKNOWN,
            label_smoothing=self.smoothing,
            reduction="sum",
        )
        counted = valid if weights is None else weights[labels.clamp(min=0)] * valid
        return total / counted.sum().clamp(min=1e-6)

    def _weights(self, device: torch.device) -> Tensor | None:
        """Class weights, copied to a device once: a copy in every step would wait for it."""
        if self.class_weights is None:
            return None
        if self._on_device is None or self._on_device.device != device:
            self._on_device = torch.tensor(self.class_weights, dtype=torch.float32, device=device)
        return self._on_device
