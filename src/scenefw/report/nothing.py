"""An empty showcase, for runs without data on their page."""

from collections.abc import Mapping

from scenefw.report.blocks import Section


class NoShowcase:
    """No data."""

    def show(self) -> tuple[tuple[Section, ...], Mapping[str, float]]:
        """Nothing."""
        return (), {}
