"""From a feature volume to a set of objects: what all networks of sets share."""

from collections.abc import Sequence

from torch import Tensor, nn

from scenefw.core.errors import ConfigError
from scenefw.core.object_sets import ObjectSetPrediction
from scenefw.models.object_codes import CodeAttention, codes_at, largest_cells
from scenefw.models.set_decoder import SetDecoder


class SetHead(nn.Module):
    """Takes the codes of N cells, and decodes each to an object (thesis figs 6.4 and 6.12).

    Args:
        slots: objects that are predicted, N.
        code_size: channels of the feature volume.
        decoder: shared by all objects.
        existence: also a logit per code that there is such an object.
        centres: also the centre of each object.
        attention: the codes of a scene see each other first.
    """

    def __init__(
        self,
        slots: int,
        code_size: int,
        decoder: SetDecoder,
        *,
        existence: bool = False,
        centres: bool = False,
        attention: bool = False,
    ) -> None:
        super().__init__()
        self.slots, self.decoder = slots, decoder
        self.attention = CodeAttention(code_size) if attention else None
        self.existence = nn.Linear(code_size, 1) if existence else None
        self.centres = nn.Linear(code_size, 3) if centres else None

    def forward(self, features: Tensor, maps: Sequence[Tensor] = ()) -> ObjectSetPrediction:
        """Objects of feature volumes (B, C, S, S, S), with a view's maps for the decoder."""
        features = features.float()
        cells = largest_cells(features, self.slots)
        codes = codes_at(features, cells)
        if self.attention is not None:
            codes = self.attention(codes)
        existence = None if self.existence is None else self.existence(codes)[..., 0]
        centres = None if self.centres is None else self.centres(codes)
        logits = self.decoder(codes, maps)
        return ObjectSetPrediction(logits, codes, cells, features, existence, centres)


def require_slots(slots: int, side: int) -> None:
    """Whether a feature volume has a cell for each object.

    Raises:
        ConfigError: it has too few, or there is no object.
    """
    if not 1 <= slots <= side**3:
        raise ConfigError(
            f"model.slots is {slots}; expected 1 to {side**3} objects, as many as the feature "
            "volume has cells (model.side)"
        )


def heads_given(*, existence: bool, centres: bool) -> set[str]:
    """Names of what is predicted beside shapes, as `ObjectSetSetup` has them."""
    return {n for n, is_on in {"existence": existence, "centres": centres}.items() if is_on}
