from scenefw.data.batches.view_samples import ObjectSamples


def test_what_is_recorded_is_read():
    samples = ObjectSamples(points=64, ends=12, width=160)
    assert ObjectSamples.of({"noise": "", **samples.facts()}) == samples


def test_weights_that_do_not_say_it_were_trained_with_the_defaults():
    assert ObjectSamples.of({"steps": 4}) == ObjectSamples(192, 48, 128)
