"""What methods of the reconstruction table share, as configured."""

import pytest

from scenefw import config, plugins
from scenefw.execution.build import Builder
from scenefw.perception.cached import Cached

NETWORKS = {"drawn_codes", "zero_code", "fitted", "drawn", "typical"}
"""Methods with volumes of a network, which have its grid."""


@pytest.fixture(scope="module")
def methods():
    """Those of the table, and those whose samples are judged as samples."""
    composed = config.compose(["run=evaluate", "debug=smoke", "device=cpu"])
    builder = Builder(composed)
    draws = builder.build("evaluation.draws.methods")
    return {**builder.build("evaluation.methods"), **draws}


@pytest.mark.parametrize("step", ["segmentation", "grouping"])
def test_methods_that_begin_with_the_same_steps_ask_one_and_the_same_object(methods, step):
    reference = getattr(methods["fitted_hulls"], step)
    assert isinstance(reference, Cached)
    assert getattr(methods["crease_parts"], step) is reference
    assert getattr(methods["drawn_fits"], step) is reference
    learnt = getattr(methods["set_extents"], step)
    assert isinstance(learnt, Cached)
    assert learnt is not reference


def test_references_learn_nothing(methods):
    learnt, reference = methods["set_extents"], methods["fitted_hulls"]
    assert type(learnt.segmentation.step).__name__ == "AffinitySegmentation"
    assert methods["fitted"].segmentation is learnt.segmentation
    assert learnt.grouping.step.rough.segmentation is None  # it fills those of the image
    assert type(reference.segmentation.step).__name__ == "CreaseSegmentation"
    filled = reference.grouping.step.rough.segmentation
    assert vars(filled) == vars(methods["hull_filling"].segmentation)
    assert vars(filled) != vars(reference.segmentation.step)  # wider creases belong to nothing
    assert methods["crease_parts"].edges is None


@pytest.mark.parametrize("evaluation", ["draws", "reconstruction"])
def test_methods_of_fits_are_compared_on_the_grid_of_the_others(evaluation):
    plugins.activate()
    words = ["run=evaluate", f"evaluation={evaluation}", "debug=smoke", "device=cpu"]
    methods = Builder(config.compose(words)).build("evaluation.methods")
    fits = {name for name, method in methods.items() if method and name not in NETWORKS}
    assert {"set_extents", "fitted_hulls"} <= fits
    assert {name for name in fits if methods[name].grid is not None} == set()


def test_the_order_of_methods_is_that_of_random_points_and_of_rows():
    composed = config.compose(["run=evaluate"])
    assert list(composed.evaluation.methods) == [
        "drawn_codes", "zero_code", "set_extents", "fitted", "fitted_hulls", "hull_filling",
        "partial_tsdf", "trained_here", "fully_convolutional", "sscnet", "unconditional",
        "crease_parts",
    ]  # fmt: skip
