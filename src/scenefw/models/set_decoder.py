"""Decoder of sets: from one code to the occupancy of one object; all objects share it."""

from collections.abc import Sequence

from torch import Tensor, nn

from scenefw.core.errors import InputError
from scenefw.models.blocks import Conv3d, ConvUnit, UpUnit, depth_to_space
from scenefw.models.object_codes import SpatialBroadcast

_EMPTY = -4.0  # objects fill few voxels of a grid


class SetDecoder(nn.Module):
    """Broadcasts a code over the feature volume's cells and doubles the side up to the grid's.

    A view's maps join at every level. Objects of one scene share them: the convolution of
    [features, map] is the sum of two, so that of the map is computed once per scene.

    Args:
        code_size: channels of a code.
        sizes: sides of the levels, coarsest first; the last is half the grid's.
        widths: channels of the levels, coarsest first.
        condition_widths: channels of a view's maps at these sizes, or None.
        empty: logit of every voxel at first.
    """

    def __init__(
        self,
        code_size: int,
        sizes: Sequence[int],
        widths: Sequence[int],
        condition_widths: Sequence[int] | None = None,
        empty: float = _EMPTY,
    ) -> None:
        super().__init__()
        self.code_size = code_size
        self.broadcast = SpatialBroadcast(sizes[0])
        self.first = ConvUnit(code_size + 3, widths[0])
        self.ups, self.refines = nn.ModuleList(), nn.ModuleList()
        for i in range(1, len(sizes)):
            self.ups.append(UpUnit(widths[i - 1], widths[i]))
            finest = i == len(sizes) - 1 and i > 1  # there the head's convolution is enough
            self.refines.append(nn.Identity() if finest else ConvUnit(widths[i], widths[i]))
        self.views = nn.ModuleList()
        for view, width in zip(condition_widths or (), widths, strict=False):
            self.views.append(Conv3d(view, width, 3, padding=1))
        self.head = Conv3d(widths[-1], 8, 3, padding=1)
        if self.head.bias is not None:
            nn.init.constant_(self.head.bias, empty)

    def forward(self, codes: Tensor, maps: Sequence[Tensor] = ()) -> Tensor:
        """Logits (B, N, X, Y, Z) of codes (B, N, C).

        Args:
            codes: of N objects per scene.
            maps: of a view per scene, at the sizes of the levels.

        Raises:
            InputError: the codes are of a decoder of another size.
        """
        if codes.ndim != 3 or codes.shape[-1] != self.code_size:
            raise InputError(
                f"codes are of shape {tuple(codes.shape)}; this decoder takes (scenes, objects, "
                f"{self.code_size}): decode them with the network that made them"
            )
        batch, count, _ = codes.shape
        features = self._add_view(self.first(self.broadcast(codes.flatten(0, 1))), maps, 0, count)
        for i, (up, refine) in enumerate(zip(self.ups, self.refines, strict=True), start=1):
            features = refine(self._add_view(up(features), maps, i, count))
        return depth_to_space(self.head(features), 2).unflatten(0, (batch, count))[:, :, 0]

    def _add_view(self, features: Tensor, maps: Sequence[Tensor], level: int, count: int) -> Tensor:
        if not len(self.views):
            return features
        view = self.views[level](maps[level])
        return (features.unflatten(0, (-1, count)) + view[:, None]).flatten(0, 1)
