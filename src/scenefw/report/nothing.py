"""Empty galleries and showcases, for runs without examples or data on their page."""

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
