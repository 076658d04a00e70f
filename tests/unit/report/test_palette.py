import numpy as np
from skimage.color import deltaE_ciede2000, rgb2lab

from scenefw.report.palette import class_colours, instance_colours

# Viénot, Brettel and Mollon (1999): what a person without red or green cones sees, linear RGB.
PROTAN = np.array([[0.11238, 0.88762, 0], [0.11238, 0.88762, 0], [0.00401, -0.00401, 1]])
DEUTAN = np.array([[0.29275, 0.70725, 0], [0.29275, 0.70725, 0], [-0.02234, 0.02234, 1]])


def test_colours_differ_for_any_colour_vision():
    colours = np.array(instance_colours(6))
    for sight in (np.eye(3), PROTAN, DEUTAN):
        seen = np.clip((colours**2.2) @ sight.T, 0, 1) ** (1 / 2.2)
        apart = np.linalg.norm(seen[:, None] - seen[None], axis=-1) + np.eye(6)
        assert apart.min() > 0.12


def test_twenty_four_then_again():
    colours = instance_colours(49)
    assert colours[24:48] == colours[:24]
    assert all(0 <= value <= 1 for colour in colours for value in colour)
    assert instance_colours(0) == []


def test_twenty_four_are_told_apart_from_each_other_and_from_the_surface():
    colours = rgb2lab(np.array([class_colours(25)]))[0]
    apart = deltaE_ciede2000(colours[:, None], colours[None])
    assert apart[np.triu_indices(25, 1)].min() > 9  # 1 is just noticeable side by side


def test_the_first_twelve_are_those_of_published_pictures():
    first = ["0072b2", "e69f00", "009e73", "cc79a7", "56b4e9", "d55e00"]
    then = ["882255", "999933", "332288", "ddcc77", "44aa99", "aa4499"]
    expected = [[int(text[i : i + 2], 16) / 255 for i in (0, 2, 4)] for text in first + then]
    np.testing.assert_allclose(instance_colours(12), expected)
