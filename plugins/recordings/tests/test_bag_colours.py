"""Which colour the depth images of a bag get."""

from itertools import islice

import numpy as np
import pytest
from plugins.recordings.tests.bag_messages import COLOUR, recording, shades, written

from scenefw.data.files.sequences import RGBDFolder
from scenefw_recordings.bags import Bag
from scenefw_recordings.unpack_bag import UnpackBag


@pytest.mark.parametrize(
    ("colour", "said"),
    [
        (np.zeros((60, 80, 3), np.uint8), "it has 80 x 60 pixels, depth 40 x 30"),
        (COLOUR, None),
    ],
)
def test_colour_of_another_size_is_left_out_with_a_line(tmp_path, capsys, colour, said):
    messages = [m for m in recording() if m[0] != "/camera/color/image_raw"]
    messages += [("/camera/color/image_raw", t, lambda s: s.image(colour, "rgb8")) for t in (1, 2)]
    figures = UnpackBag(written(tmp_path / "r", messages), tmp_path / "out").run()
    assert figures == {"images": 3.0, "coloured": 0.0 if said else 3.0}
    assert (said or "") in capsys.readouterr().err


@pytest.mark.parametrize("old", [True, False])
def test_colour_is_the_nearest_in_time_or_none(tmp_path, old):
    messages = shades([2, 3, 4, 4.5], [0.5, 1.5, 2.2, 2.6, 2.8, 3.9, 4.6, 9])
    bag = Bag(written(tmp_path / ("r.bag" if old else "r"), messages, old))
    frames = list(bag.frames())
    numbers = [None if f.colour is None else int(f.colour[0, 0, 0]) for f in frames]
    assert numbers == [None, 0, 0, 1, 1, 2, 3, None]
    assert frames[0].notes[1] == (
        "no colour for 2 of 8 depth images: /camera/color/image_raw has none within 1 s of them"
    )
    every_third = [int(f.colour[0, 0, 0]) for f in islice(bag.frames(3), 1, None)]
    assert every_third == [1, 3]


def test_what_is_written_is_a_sequence_with_colour_for_all_images(tmp_path, capsys):
    path = written(tmp_path / "r", shades([2, 3, 4], [0.5, 2.2, 3.1, 9]))
    figures = UnpackBag(path, tmp_path / "out").run()
    assert figures == {"images": 2.0, "coloured": 2.0}
    assert "2 of 4 depth images are left out" in capsys.readouterr().err
    folder = tmp_path / "out" / "recording"
    sequence = RGBDFolder(folder, require_poses=False)
    assert [frame.colour[0, 0, 0] for frame in sequence] == [0, 1]
    assert [float(t) for t in (folder / "times.txt").read_text().split()] == [2.2, 3.1]
    assert UnpackBag(path, tmp_path / "out", colour="none").run()["images"] == 4
    assert all(frame.colour is None for frame in RGBDFolder(folder, require_poses=False))


@pytest.mark.parametrize("encoding", ["mono8", "bayer_rggb8"])
def test_colour_that_cannot_be_read_is_left_out_with_a_line(tmp_path, capsys, encoding):
    messages = recording()[:3]
    messages[1] = (messages[1][0], 1, lambda s: s.image(COLOUR[..., 0], encoding))
    figures = UnpackBag(written(tmp_path / "r", messages), tmp_path / "out").run()
    assert figures == {"images": 1.0, "coloured": 0.0}
    assert f"colour is left out: /camera/color/image_raw is encoded as {encoding}" in (
        capsys.readouterr().err
    )
    assert len(RGBDFolder(tmp_path / "out" / "recording", require_poses=False)) == 1
