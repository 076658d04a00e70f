import json

import numpy as np
import pytest
from PIL import Image
from plugins.doctor.tests.test_examination import EXAMINER, FRAME

from scenefw.core.errors import ConfigError, IncompleteError, InputError
from scenefw_doctor.task import Examine


def save(path, depth=FRAME.depth, **changes):
    np.savez(path, **({"depth": depth, "K": FRAME.camera.matrix} | changes))
    return path


def test_each_image_gets_verdicts_and_a_picture(tmp_path, capsys):
    (tmp_path / "in").mkdir()
    save(tmp_path / "in" / "a.npz")
    save(tmp_path / "in" / "b.npz", np.where(np.arange(160) % 4 == 0, FRAME.depth, 0))
    save(tmp_path / "in" / "c.npz", FRAME.depth * 1000)
    save(tmp_path / "in" / "d.npz", K=FRAME.camera.matrix * (10, 10, 1))
    with pytest.raises(IncompleteError, match=r"^2 of 4 images are unusable, see above") as end:
        Examine(tmp_path / "in", EXAMINER, tmp_path / "out").run()
    assert end.value.figures == {"images": 4, "odd": 1, "unusable": 2}
    said = capsys.readouterr().out.splitlines()
    verdicts = [line for line in said if not line.startswith(" ")]
    assert verdicts == [
        "a.npz: usable", "b.npz: usable, but odd", "c.npz: unusable", "d.npz: unusable"
    ]  # fmt: skip
    odd = next(i for i, line in enumerate(said) if line.split()[0] == "odd")
    assert "only 25% of the pixels have a depth" in said[odd]
    assert said[odd + 1].split()[0] == "fix"
    assert any("millimetres given as metres?" in line for line in said)
    assert sorted(path.name for path in (tmp_path / "out").iterdir()) == [
        "a.png", "b.png", "d.png"
    ]  # fmt: skip


def test_masks_are_looked_at_too(tmp_path):
    image = save(tmp_path / "a.npz")
    Image.fromarray(np.uint8(FRAME.labels == 0)).save(tmp_path / "mask.png")
    with pytest.raises(InputError, match="that the mask covers them"):
        Examine(image, EXAMINER, tmp_path / "out", masks=tmp_path / "mask.png").run()
    assert (tmp_path / "out" / "a.png").is_file()  # shows why


def test_the_error_names_the_check_that_failed(tmp_path):
    image = save(tmp_path / "a.npz", K=FRAME.camera.matrix * (10, 10, 1))
    with pytest.raises(InputError, match=r"^intrinsics of a give a view of .*; give fx, fy"):
        Examine(image, EXAMINER, tmp_path / "out").run()


def test_pictures_replace_neither_images_nor_masks(tmp_path):
    (tmp_path / "in").mkdir()
    depth = Image.fromarray(np.uint16(FRAME.depth * 1000))
    depth.save(tmp_path / "in" / "a.png")
    with pytest.raises(ConfigError, match="is the folder of the input"):
        Examine(tmp_path / "in" / "a.png", EXAMINER, tmp_path / "in")
    with pytest.raises(ConfigError, match="is the folder of the input"):
        Examine(save(tmp_path / "a.npz"), EXAMINER, tmp_path / "in", masks=tmp_path / "in")
    with Image.open(tmp_path / "in" / "a.png") as image:
        np.testing.assert_array_equal(np.array(image), np.array(depth))


def test_an_input_is_needed():
    with pytest.raises(ConfigError, match="run=doctor needs input=PATH"):
        Examine(None, EXAMINER)


def test_command_line(tmp_path, scenefw):
    save(tmp_path / "a.npz")
    done = scenefw("run=doctor", "input=a.npz", "paths.output=out")
    assert done.returncode == 0, done.stderr
    assert "a.npz: usable" in done.stdout
    assert (tmp_path / "out" / "a.png").is_file()
    assert json.loads((tmp_path / "out" / "metrics.json").read_text())["unusable"] == 0
    save(tmp_path / "b.npz", FRAME.depth * 1000)
    done = scenefw("run=doctor", "input=b.npz", "paths.output=out")
    assert done.returncode == 2
    (line,) = done.stderr.splitlines()
    assert line.startswith("error: depth of b.npz has a median of")
    assert line.endswith("depth in floats is in metres; multiply it by 0.001")
