"""Which topics of a bag belong together."""

import pytest

from scenefw.core.errors import InputError
from scenefw_recordings.topics import topics_of

ALIGNED = "/c/aligned_depth_to_color/image_raw"


@pytest.mark.parametrize(
    ("depth", "colours", "colour"),
    [
        ("/camera/aligned_depth_to_color/image_raw", ["/camera/color/image_raw"], 0),
        ("/c/depth_registered/image_raw", ["/c/rgb/image_rect_color", "/c/rgb/image_raw"], 1),
        ("/c/registered_depth/image_rect_raw", ["/c/rgb/image_rect_color", "/c/rgb/image_raw"], 0),
        ("/z/depth/depth_registered", ["/z/rgb/image_raw_color", "/z/rgb/image_rect_color"], 1),
        ("/depth_to_rgb/image_raw", ["/rgb/image_raw"], 0),
        ("/depth/image_raw", ["/rgb/image_raw", "/rgb_to_depth/image_raw"], 1),
        ("/camera/depth/image_rect_raw", ["/camera/color/image_raw"], None),
    ],
)  # fmt: skip
def test_colour_is_that_in_the_pixels_of_depth(depth, colours, colour):
    info = depth.rpartition("/")[0] + "/camera_info"
    kinds = dict.fromkeys([depth, *colours], "Image") | {info: "CameraInfo"}
    topics = topics_of(kinds, None, None, None)
    assert (topics.depth, topics.info) == (depth, info)
    assert topics.colour == (None if colour is None else colours[colour])
    assert len(topics.notes) == 1 + (colour is None)


def test_topics_beside_each_other_are_taken():
    kinds = {
        "/left/depth/image": "Image", "/left/depth/camera_info": "CameraInfo",
        "/left/color/image": "Image", "/left/color/camera_info": "CameraInfo",
    }  # fmt: skip
    topics = topics_of(kinds, None, None, None)
    assert (topics.depth, topics.info) == ("/left/depth/image", "/left/depth/camera_info")
    assert topics.colour is None  # nothing says that it is aligned
    assert topics_of(kinds, None, "/left/color/image", None).colour == "/left/color/image"


@pytest.mark.parametrize(
    ("depth", "colour", "infos", "info"),
    [
        (ALIGNED, "/c/color/image_raw", ["/c/depth", "/c/color"], 1),
        (ALIGNED, "/c/color/image_raw", ["/c/color", "/c/aligned_depth_to_color"], 1),
        (ALIGNED, None, ["/c/depth", "/c/infra1", "/c/color"], 2),
        ("/depth_to_rgb/image_raw", "/rgb/image_raw", ["/depth", "/rgb"], 1),
        ("/c/depth/image", None, ["/c/rgb", "/c/depth"], 1),
        ("/c/depth/image", None, ["/c/rgb", "/c"], 1),
        ("/c/aligned_depth", "/c/color", ["/c/depth", "/c/color"], 1),
        (ALIGNED, "/c/color/image_raw", ["/c/depth", "/c/infra1"], "no topic beside"),
        ("/c/depth/image", None, ["/c/rgb"], "no topic beside"),
        ("/a/c/depth/image", None, ["/a/d/depth"], "no topic beside"),
        ("/c/depth/image", None, ["/c/infra1", "/c/infra2"], "fit alike"),
    ],
)
def test_intrinsics_are_of_the_sensor_in_whose_pixels_depth_is(depth, colour, infos, info):
    names = [f"{name}/camera_info" for name in infos]
    kinds = dict.fromkeys(names, "CameraInfo") | {depth: "Image"}
    if colour is not None:
        kinds[colour] = "Image"
    if isinstance(info, str):
        with pytest.raises(InputError, match=rf"{info}.*give run\.info=TOPIC"):
            topics_of(kinds, None, None, None)
    else:
        assert topics_of(kinds, None, None, None).info == names[info]


def test_colour_is_of_the_camera_of_depth():
    depths = [f"/cam{n}/aligned_depth_to_color/image_raw" for n in (1, 2)]
    colours = [f"/cam{n}/color/image_raw" for n in (1, 2)]
    infos = [f"/cam{n}/color/camera_info" for n in (1, 2)]
    kinds = dict.fromkeys([*depths, *colours], "Image") | dict.fromkeys(infos, "CameraInfo")
    topics = topics_of(kinds, depths[1], None, None)
    assert (topics.colour, topics.info) == (colours[1], infos[1])
    assert topics.notes == (f"read: depth {depths[1]}, intrinsics {infos[1]}, colour {colours[1]}",)
    with pytest.raises(InputError, match=r"are of several cameras; give run\.depth=TOPIC"):
        topics_of(kinds, None, None, None)
    of_first = {name: kind for name, kind in kinds.items() if name != colours[1]}
    topics = topics_of(of_first, depths[1], None, infos[1])
    assert topics.colour is None
    assert "nothing says that it is aligned" in topics.notes[1]
    anywhere = {"/depth_registered/image": "Image", "/depth_registered/camera_info": "CameraInfo"}
    anywhere |= dict.fromkeys(colours, "Image")
    with pytest.raises(InputError, match=r"several cameras; give run\.colour=none or run\.colour="):
        topics_of(anywhere, None, None, None)
    assert topics_of(anywhere, None, "none", None).colour is None
