"""What shows nothing, where a run needs no examples or no data on its page."""

from collections.abc import Mapping

from scenefw.report.blocks import Block, Section


class NoGallery:
    """No examples."""

    def show(self) -> tuple[Block, ...]:
        """Nothing."""
        return ()


class NoShowcase:
    """No data."""

    def show(self) -> tuple[tuple[Section, ...], Mapping[str, float]]:
        """Nothing."""
        return (), {}
