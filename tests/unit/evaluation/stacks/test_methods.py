from scenefw import config
from scenefw.evaluation.stacks.measures import of_scores
from scenefw.evaluation.stacks.methods import REFERENCES, described


def test_all_methods_of_the_table_are_described():
    evaluation = config.compose(["run=evaluate"]).evaluation
    names = [*evaluation.methods, *evaluation.draws.methods, *evaluation.extractors]
    assert len(names) > 8
    for name in names:
        assert {described(name).row, described(name).samples} != {name.replace("_", " ")}
    assert len({described(name).row for name in names}) == len(names)


def test_a_method_without_an_entry_goes_by_its_name():
    found = described("some_method")
    assert (found.row, found.samples, found.draws) == ("some method",) * 3
    assert found.figure == ", some method"
    assert found.learns


def test_what_learns_is_measured_against_the_strongest_reference_of_its_table():
    assert REFERENCES == ("fitted_hulls", "fitted_parts", "hull_filling")
    figures = of_scores(
        ["drawn_codes", "zero_code", "partial_tsdf", "hull_filling"], ["drawn_codes"]
    )
    assert figures["instance_iou"].trivial == "hull_filling/instance_iou"
    assert figures["zero_code/instance_iou"].trivial == "hull_filling/instance_iou"
    assert figures["partial_tsdf/instance_iou"].trivial is None
    assert figures["zero_code/instance_iou"].name == "instance IoU of the zero code alone"


def test_draws_that_learn_are_measured_against_draws_that_do_not():
    drawn = ["coupled", "set_extents", "fitted_hulls", "drawn_fits"]
    figures = of_scores(["coupled", "fitted_hulls"], drawn)
    for name in ("coupled", "set_extents"):
        assert figures[f"draws/{name}/energy"].trivial == "draws/drawn_fits/energy"
    for name in ("fitted_hulls", "drawn_fits"):
        assert figures[f"draws/{name}/energy"].trivial is None
    figures = of_scores(["coupled", "fitted_hulls"], drawn[:-1])
    assert figures["draws/set_extents/energy"].trivial == "draws/fitted_hulls/energy"
