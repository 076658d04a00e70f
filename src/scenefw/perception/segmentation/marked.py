"""Objects that someone has marked."""

from __future__ import annotations

from typing import TYPE_CHECKING

from scenefw.core.errors import InputError

if TYPE_CHECKING:
    from scenefw.core.types import Int32
    from scenefw.perception.observation.views import View


class MarkedObjects:
    """The masks that came with the image: each is one object."""

    def segment(self, view: View, /) -> Int32:
        """The masks (H, W).

        Raises:
            InputError: nobody has marked objects.
        """
        if view.masks is None:
            raise InputError("no objects are marked in this image; give masks")
        return view.masks
