import sys

import numpy as np
import pytest
from tests.unit.perception.synthetic import camera_at, frame_of

from scenefw.core.errors import InputError, MissingDependencyError
from scenefw.data.files.readers import read_frame

CAMERA = camera_at(size=(80, 60))


def test_depth_of_a_renderer_is_read(tmp_path):
    exr = pytest.importorskip("OpenEXR")
    depth = frame_of(CAMERA).depth
    far = np.where(np.arange(80) < 5, np.float32(1e10), depth)
    header = {"compression": exr.ZIP_COMPRESSION, "type": exr.scanlineimage}
    with exr.File(header, {"Z": far, "A": 0 * far}) as file:
        file.write(str(tmp_path / "a.exr"))
    np.savetxt(tmp_path / "K.txt", CAMERA.matrix)
    read = read_frame(tmp_path / "a.exr")
    np.testing.assert_array_equal(read.depth[:, 5:], depth[:, 5:])
    assert (read.depth[:, :5] == 0).all()
    with pytest.raises(InputError, match=r"^depth_scale = 0\.001 changes nothing for a\.exr"):
        read_frame(tmp_path / "a.exr", depth_scale=0.001)
    (tmp_path / "b.exr").write_bytes((tmp_path / "a.exr").read_bytes()[:100])
    with pytest.raises(InputError, match=r"cannot read .*b\.exr"):
        read_frame(tmp_path / "b.exr")


def test_a_missing_library_is_one_line(tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "OpenEXR", None)
    (tmp_path / "a.exr").write_bytes(b"")
    with pytest.raises(
        MissingDependencyError, match=r"a\.exr needs OpenEXR: pip install 'scenefw\[exr\]'"
    ):
        read_frame(tmp_path / "a.exr")


def test_a_part_of_a_render_is_refused(tmp_path):
    exr = pytest.importorskip("OpenEXR")
    depth = frame_of(CAMERA).depth
    windows = {
        "dataWindow": tuple(np.array(end, np.int32) for end in ((20, 0), (79, 59))),
        "displayWindow": tuple(np.array(end, np.int32) for end in ((0, 0), (79, 59))),
    }
    with exr.File({"type": exr.scanlineimage, **windows}, {"Z": depth[:, 20:].copy()}) as file:
        file.write(str(tmp_path / "a.exr"))
    np.savetxt(tmp_path / "K.txt", CAMERA.matrix)
    with pytest.raises(InputError, match=r"a\.exr holds the part \[\[20, 0\], \[79, 59\]\]"):
        read_frame(tmp_path / "a.exr")
