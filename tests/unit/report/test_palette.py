import numpy as np

from scenefw.report.palette import instance_colours

# Viénot, Brettel and Mollon (1999): what a person without red or green cones sees, linear RGB.
PROTAN = np.array([[0.11238, 0.88762, 0], [0.11238, 0.88762, 0], [0.00401, -0.00401, 1]])
DEUTAN = np.array([[0.29275, 0.70725, 0], [0.29275, 0.70725, 0], [-0.02234, 0.02234, 1]])


def test_colours_differ_for_any_colour_vision():
    colours = np.array(instance_colours(6))
    for sight in (np.eye(3), PROTAN, DEUTAN):
        seen = np.clip((colours**2.2) @ sight.T, 0, 1) ** (1 / 2.2)
        apart = np.linalg.norm(seen[:, None] - seen[None], axis=-1) + np.eye(6)
        assert apart.min() > 0.12


def test_twelve_then_again():
    colours = instance_colours(25)
    assert len(set(colours[:12])) == 12
    assert colours[12:24] == colours[:12]
    assert all(0 <= value <= 1 for colour in colours for value in colour)
    assert instance_colours(0) == []
