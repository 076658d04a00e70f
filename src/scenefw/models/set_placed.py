"""Autoencoder of sets whose codes tell what an object is apart from where it is."""

from collections.abc import Sequence
from typing import Literal

from torch import Tensor

from scenefw.core.object_sets import ObjectSetPrediction
from scenefw.models.placed_head import PlacedHead
from scenefw.models.recipes import recipe_of
from scenefw.models.seen_volumes import CHANNELS, VolumeDecomposer
from scenefw.models.set_encoder import SetEncoder, averaged, block_side, level_sizes
from scenefw.models.set_head import require_slots


class PlacedSetAutoencoder(VolumeDecomposer):
    """Decomposes a scene into objects, each a shape in a box (an answer to thesis fig. 6.9).

    Args:
        resolution: voxels per side.
        slots: objects that it predicts; scenes with fewer leave some empty.
        sees: occupancy, the complete scene; or view, the partial TSDF of one depth image.
        code_size: numbers per object, the channels of the feature volume.
        side: cells per side of the feature volume.
        encoder_widths: channels of the encoder's levels, coarsest first, as many as are needed.
        decoder_widths: channels of the decoder's levels, coarsest first; with two, a shape has
            16 voxels per side.
        seen_resolution: voxels per side that the encoder sees: those of a finer grid are averaged
            first, so weights that were trained on a coarse grid go on with a finer one. None: all.
        attention: the codes of a scene see each other before they are decoded.

    Raises:
        ConfigError: sizes don't go together, or it sees neither.
    """

    def __init__(
        self,
        resolution: int = 64,
        slots: int = 10,
        sees: Literal["occupancy", "view"] = "occupancy",
        code_size: int = 128,
        side: int = 8,
        encoder_widths: Sequence[int] = (128, 64, 32),
        decoder_widths: Sequence[int] = (96, 32),
        seen_resolution: int | None = None,
        *,
        attention: bool = True,
    ) -> None:
        super().__init__(sees, resolution)
        self.recipe = recipe_of(self, locals())
        require_slots(slots, side)
        self.block = block_side(resolution, seen_resolution)
        sizes = level_sizes(resolution // self.block, side, encoder_widths, "encoder_widths")
        self.slots = slots
        self.gives = {"existence", "centres", "boxes"}
        self.encoder = SetEncoder(
            CHANNELS[sees], sizes, list(encoder_widths)[: len(sizes)][::-1], code_size
        )
        self.head = PlacedHead(
            resolution, slots, code_size, side, decoder_widths, attention=attention
        )

    def objects_of(self, volume: Tensor) -> ObjectSetPrediction:
        """Objects of a volume of the right shape."""
        prediction: ObjectSetPrediction = self.head(self.encoder(averaged(volume, self.block)))
        return prediction
