"""From a feature volume to objects, each a shape in a box of its own."""

from collections.abc import Sequence

import torch
from torch import Tensor, nn

from scenefw.core.errors import ConfigError, InputError
from scenefw.core.object_sets import ObjectSetPrediction
from scenefw.models.object_codes import CodeAttention, codes_at, largest_cells
from scenefw.models.placed_shapes import placed, places_of
from scenefw.models.set_decoder import SetDecoder

_HALF = 0.12  # half a side of a box at first, in half sides of the grid
_SMALLEST, _LARGEST = 0.02, 1.0


class PlacedHead(nn.Module):
    """Takes the codes of N cells, and decodes each to a shape that its box moves and scales.

    As in thesis 6.2.1 all objects share the decoder. But it fills a box of the object's own, so an
    object looks the same wherever it stands, as in spatial transformers (Jaderberg et al. 2015;
    Eslami et al. 2016), its cell only has to be near, and decoding costs the same for every grid.

    Args:
        resolution: voxels per side of the grid.
        slots: objects that are predicted, N.
        code_size: channels of the feature volume.
        side: cells per side of the feature volume.
        widths: channels of the decoder's levels, coarsest first; a shape has 2^(levels + 2) voxels
            per side.
        attention: the codes of a scene see each other, and from where they are, first.

    Raises:
        ConfigError: the widths are none.
    """

    def __init__(
        self,
        resolution: int,
        slots: int,
        code_size: int,
        side: int,
        widths: Sequence[int],
        *,
        attention: bool,
    ) -> None:
        super().__init__()
        if not 1 <= len(widths) <= 4 or min(widths) < 1:
            raise ConfigError(
                f"model.decoder_widths is {list(widths)}; expected one to four positive widths, "
                "coarsest first"
            )
        self.resolution, self.slots, self.side = resolution, slots, side
        self.place = nn.Linear(3, code_size) if attention else None
        self.attention = CodeAttention(code_size) if attention else None
        self.existence = nn.Linear(code_size, 1)
        self.boxes = Boxes(code_size, side)
        sizes = [4 * 2**i for i in range(len(widths))]
        self.decoder = SetDecoder(code_size, sizes, [int(width) for width in widths], empty=0.0)

    def forward(self, features: Tensor) -> ObjectSetPrediction:
        """Objects of feature volumes (B, C, S, S, S)."""
        features = features.float()
        cells = largest_cells(features, self.slots)
        codes = codes_at(features, cells)
        if self.attention is not None and self.place is not None:
            codes = self.attention(codes + self.place(places_of(cells, self.side)))
        boxes = self.boxes(codes, cells)
        return ObjectSetPrediction(
            self.decode(codes, boxes),
            codes,
            cells,
            features,
            existence=self.existence(codes)[..., 0],
            centres=boxes[..., 0, :],
            boxes=boxes,
        )

    def decode(self, codes: Tensor, boxes: Tensor) -> Tensor:
        """Logits (B, N, X, Y, Z) of objects that look as codes (B, N, C) say.

        Args:
            codes: of what objects are.
            boxes: (B, N, 2, 3) where they are: centres and half sides in the cube of the grid.

        Raises:
            InputError: the codes are of another decoder, or they have not a box each.
        """
        if tuple(boxes.shape) != (*codes.shape[:2], 2, 3):
            raise InputError(
                f"{tuple(boxes.shape)} boxes for codes {tuple(codes.shape)}; expected (scenes, "
                "objects, 2, 3): a centre and half sides for each code"
            )
        return placed(self.decoder(codes).float(), boxes, self.resolution)


class Boxes(nn.Module):
    """Boxes along the axes of the grid, one for each code, near the cell that it was taken from.

    Args:
        code_size: channels of a code.
        side: cells per side of the feature volume.
    """

    def __init__(self, code_size: int, side: int) -> None:
        super().__init__()
        self.side = side
        self.offsets = nn.Linear(code_size, 6)
        nn.init.normal_(self.offsets.weight, std=0.01)
        nn.init.zeros_(self.offsets.bias)

    def forward(self, codes: Tensor, cells: Tensor) -> Tensor:
        """Boxes (B, N, 2, 3) of codes (B, N, C) and cells (B, N): centres, then half sides.

        In the cube of the grid, each axis from -1 to 1.
        """
        places = places_of(cells, self.side)
        move, growth = self.offsets(codes).float().chunk(2, dim=-1)
        halves = (_HALF * growth.clamp(-4.0, 4.0).exp()).clamp(_SMALLEST, _LARGEST)
        return torch.stack([places + 2 / self.side * move, halves], dim=-2)
