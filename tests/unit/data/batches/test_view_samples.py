from scenefw.data.batches.view_samples import ObjectSamples, points_of_view, view_facts


def test_what_is_recorded_is_read():
    samples = ObjectSamples(points=64, ends=12, width=160)
    assert ObjectSamples.of({"noise": "", **samples.facts()}) == samples
    assert points_of_view(view_facts(300)) == 300


def test_weights_that_do_not_say_it_were_trained_with_the_defaults():
    assert ObjectSamples.of({"steps": 4}) == ObjectSamples(192, 48, 128)
    assert points_of_view({}) == 1024
