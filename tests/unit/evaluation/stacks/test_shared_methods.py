"""What methods of the reconstruction table share, as configured."""

from scenefw import config
from scenefw.execution.build import Builder
from scenefw.perception.cached import Remembered


def test_methods_that_begin_with_the_same_scenes_ask_one_and_the_same_object():
    composed = config.compose(["run=evaluate", "debug=smoke", "device=cpu"])
    methods = Builder(composed).build("evaluation.methods")
    assert methods["fitted"].inner.inner is methods["zero_code"]
    grouped = methods["fitted_hulls"].inner
    assert isinstance(grouped, Remembered)
    assert methods["crease_parts"].inner is grouped
    assert grouped.inner.inner is methods["hull_filling"]
    learnt = methods["set_flow"].inner
    assert learnt.inner.inner.parts is None  # it fills those of the image
    assert grouped.inner.inner.parts is not None
    assert type(learnt.inner.parts).__name__ == "AffinityParts"
    assert type(grouped.inner.parts).__name__ == "SeenParts"  # the reference learns nothing


def test_the_order_of_methods_is_that_of_random_points_and_of_rows():
    composed = config.compose(["run=evaluate"])
    assert list(composed.evaluation.methods) == [
        "scenefw", "zero_code", "set_flow", "fitted", "fitted_hulls", "hull_filling",
        "partial_tsdf", "trained_here", "fully_convolutional", "sscnet", "unconditional",
        "crease_parts",
    ]  # fmt: skip
