"""Presentation of this chapter's results."""

from pathlib import Path

from scenefw.core.protocols import Result
from scenefw.evaluation.stacks.confidence_results import ConfidenceResult
from scenefw.evaluation.stacks.grasping_results import GraspingResult
from scenefw.evaluation.stacks.labelled_masks import LabelledMaskResult
from scenefw.evaluation.stacks.latent_space_results import LatentSpaceResult
from scenefw.evaluation.stacks.ranking_results import RankingResult
from scenefw.evaluation.stacks.results import ReconstructionResult
from scenefw.evaluation.stacks.several_views_results import SeveralViewsResult
from scenefw.evaluation.stacks.stability_results import StabilityResult
from scenefw.report.blocks import Section
from scenefw.report.presentation import Show, sections_by_class
from scenefw.report.stacks.confidence import confidence_sections
from scenefw.report.stacks.grasping import grasping_sections
from scenefw.report.stacks.labelled_masks import labelled_mask_sections
from scenefw.report.stacks.latent_space import latent_space_sections
from scenefw.report.stacks.ranking import ranking_sections
from scenefw.report.stacks.reconstruction import reconstruction_sections
from scenefw.report.stacks.several_views import several_views_sections
from scenefw.report.stacks.stability import stability_sections

_SHOWN_BY: dict[type, Show] = {
    ReconstructionResult: lambda result, _: reconstruction_sections(result),
    LabelledMaskResult: labelled_mask_sections,
    SeveralViewsResult: several_views_sections,
    GraspingResult: grasping_sections,
    LatentSpaceResult: lambda result, _: latent_space_sections(result),
    ConfidenceResult: lambda result, _: confidence_sections(result),
    RankingResult: lambda result, _: ranking_sections(result),
    StabilityResult: lambda result, _: stability_sections(result),
}


class StackResults:
    """Reconstructions beside the thesis's, several views, codes, stability, grasps, real images."""

    def sections(self, result: Result, folder: Path) -> tuple[Section, ...]:
        """Sections of the chapter's results; other results get a table of their figures."""
        return sections_by_class(result, folder, _SHOWN_BY)
