"""Energy score of blocks of voxels: samples that are likely as a whole."""

import torch
from torch import Tensor
from torch.nn import functional

from scenefw.core.batches import ShapeInstanceBatch, ShapeInstancePrediction, ShapeInstanceSetup
from scenefw.core.errors import ConfigError
from scenefw.core.settings import COUNT
from scenefw.losses.targets import require_draws, require_target

_EPSILON = 1e-4  # truncations^2: the root's slope stays finite where two samples agree


class BlockEnergy:
    """Energy score of two samples of a view in blocks of the volume (Gneiting and Raftery 2007).

    (|b' - b| + |b'' - b| - |b' - b''|) / 2 with |.| the root mean square over a block's voxels,
    the mean over blocks. It is least if the blocks of samples are distributed as those of the truth
    are, given the view. The loss `sample_spread` asks that of single voxels, which samples satisfy
    whose voxels differ independently; here those of a block have to differ together.

    Args:
        weight: factor of this term in the total; any, as the term is a proper score on its own.
        block: side of a block (voxels).
        target: name of the representation.

    Raises:
        ConfigError: a block has no voxel.
    """

    needs_draws = True

    def __init__(self, weight: float = 1.0, block: int = 8, target: str = "tsdf") -> None:
        COUNT.require(block=block)
        self.weight, self.block, self.target = weight, block, target

    def check(self, setup: ShapeInstanceSetup) -> None:
        """Checks that these volumes fit.

        Raises:
            ConfigError: there is no such volume, no view has two codes, or blocks don't fill it.
        """
        require_target("block_energy", self.target, setup)
        require_draws("block_energy", setup)
        self._require_blocks(setup.grid.resolution)

    def _require_blocks(self, resolution: int) -> None:
        if resolution % self.block:
            raise ConfigError(
                f"loss.block_energy.block is {self.block}, the volume has {resolution} voxels per "
                "side; give a block that divides it"
            )

    def __call__(self, prediction: ShapeInstancePrediction, batch: ShapeInstanceBatch) -> Tensor:
        """A scalar of at least 0, the mean over blocks of the views with two codes.

        Raises:
            ConfigError: no view was predicted with two codes, or blocks don't fill the volume.
        """
        redrawn = prediction.redrawn
        if redrawn is None:
            raise ConfigError(
                "the loss block_energy needs two codes per view; give model.prior_share of more "
                "than 0 and a batch large enough for it, or leave the loss out"
            )
        true = batch.targets[self.target]
        self._require_blocks(true.shape[-1])
        truth = true[redrawn.rows].float()
        first = prediction.volumes[self.target][redrawn.rows].float().clamp(-1, 1)
        second = redrawn.volumes[self.target].float().clamp(-1, 1)
        errors = self._distances(first, truth) + self._distances(second, truth)
        return 0.5 * (errors - self._distances(first, second)).mean()

    def _distances(self, first: Tensor, second: Tensor) -> Tensor:
        """Root mean square of differences over each block."""
        squares = functional.avg_pool3d((first - second).square(), self.block)
        return torch.sqrt(squares + _EPSILON)
