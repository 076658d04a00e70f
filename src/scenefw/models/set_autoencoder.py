"""Autoencoder of sets: a scene, whole or seen from one side, as one code per object."""

from collections.abc import Sequence
from typing import Literal

from torch import Tensor

from scenefw.core.object_sets import ObjectSetPrediction
from scenefw.models.recipes import recipe_of
from scenefw.models.seen_volumes import CHANNELS, VolumeDecomposer
from scenefw.models.set_decoder import SetDecoder
from scenefw.models.set_encoder import SetEncoder, level_sizes
from scenefw.models.set_head import SetHead, heads_given, require_slots


class SetAutoencoder(VolumeDecomposer):
    """Decomposes a scene into the occupancy of its objects (thesis 6.2.1 and 6.2.2, fig. 6.4).

    Args:
        resolution: voxels per side.
        slots: objects that it predicts; scenes with fewer leave some empty.
        sees: occupancy, the complete scene; or view, the partial TSDF of one depth image.
        code_size: numbers per object, the channels of the feature volume.
        side: cells per side of the feature volume.
        encoder_widths: channels of the encoder's levels, coarsest first, as many as are needed.
        decoder_widths: the same of the decoder.
        existence: also predict for each object whether it is there.
        centres: also predict where each object's centre is.
        attention: the codes of a scene see each other before they are decoded.

    Raises:
        ConfigError: sizes don't go together, or it sees neither.
    """

    def __init__(
        self,
        resolution: int = 64,
        slots: int = 8,
        sees: Literal["occupancy", "view"] = "occupancy",
        code_size: int = 128,
        side: int = 4,
        encoder_widths: Sequence[int] = (128, 96, 48, 24),
        decoder_widths: Sequence[int] = (96, 48, 24, 16),
        *,
        existence: bool = False,
        centres: bool = False,
        attention: bool = False,
    ) -> None:
        super().__init__(sees, resolution)
        self.recipe = recipe_of(self, locals())
        require_slots(slots, side)
        sizes = level_sizes(resolution, side, encoder_widths, "encoder_widths")
        level_sizes(resolution, side, decoder_widths, "decoder_widths")
        levels = len(sizes)
        self.slots = slots
        self.gives = heads_given(existence=existence, centres=centres)
        self.encoder = SetEncoder(
            CHANNELS[sees], sizes, list(encoder_widths)[:levels][::-1], code_size
        )
        self.head = SetHead(
            slots,
            code_size,
            SetDecoder(code_size, sizes[::-1], list(decoder_widths)[:levels]),
            existence=existence,
            centres=centres,
            attention=attention,
        )

    def objects_of(self, volume: Tensor) -> ObjectSetPrediction:
        """Objects of a volume of the right shape."""
        prediction: ObjectSetPrediction = self.head(self.encoder(volume))
        return prediction
