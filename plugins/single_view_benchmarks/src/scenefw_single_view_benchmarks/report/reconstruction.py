"""Reconstructions, as the core shows them, beside what else stands on a page."""

from scenefw.report.stacks.reconstruction import SECTIONS

__all__ = ["SECTIONS"]
