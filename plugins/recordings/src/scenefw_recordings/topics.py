"""Which topics of a bag are depth, its intrinsics, and colour from the same camera."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from scenefw.core.errors import InputError

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping, Sequence

NO_COLOUR = "none"
"""Instead of a topic: colour is left out."""

_IMAGE, _COMPRESSED, _INFO = "Image", "CompressedImage", "CameraInfo"
_REGISTERED_DEPTH = ("aligned", "registered", "depth_to_rgb", "depth_to_color", "depth_to_colour")
"""Words in topics of depth in the pixels of colour: librealsense, OpenNI, ZED, Azure Kinect."""
_REGISTERED_COLOUR = ("rgb_to_depth", "color_to_depth", "colour_to_depth")
"""Words in topics of colour in the pixels of depth."""
_COLOUR = ("color", "colour", "rgb")
_SENSOR = ("depth", *_REGISTERED_DEPTH, *_COLOUR)
_MIN_SHARED = 2  # words of neighbours: the empty one before the first slash, and one more


@dataclass(frozen=True)
class Topics:
    """Names of what is read.

    Args:
        depth: images of depth.
        info: their intrinsics.
        colour: images from the same place and of the same size; None: there are none.
        unit: metres per unit of integer depth, as one message; None: millimetres.
        notes: which topics these are, and why colour is left out, a line each.
    """

    depth: str
    info: str
    colour: str | None = None
    unit: str | None = None
    notes: tuple[str, ...] = ()


def topics_of(
    kinds: Mapping[str, str], depth: str | None, colour: str | None, info: str | None
) -> Topics:
    """What to read of a bag.

    Args:
        kinds: last word of the type of each topic's messages, by topic.
        depth: the topic of depth, if it is known; likewise the following.
        colour: of colour; `none` leaves it out.
        info: of the intrinsics of depth.

    Raises:
        InputError: there is no such topic, none that could be meant, or several.
    """
    images = (_IMAGE, _COMPRESSED)
    given_colour = None if colour == NO_COLOUR else colour
    for name, expected in ((depth, images), (given_colour, images), (info, (_INFO,))):
        if name is not None and kinds.get(name) not in expected:
            raise InputError(
                f"there is no topic {name} of {' or '.join(expected)}; the bag has {_listed(kinds)}"
            )
    pictures = [name for name, kind in sorted(kinds.items()) if kind in images]
    depth = depth or _depth_topic(pictures, kinds)
    notes: tuple[str, ...] = ()
    if colour is None:
        given_colour, notes = _colour_topic(pictures, kinds, depth)
    info = info or _info_topic(kinds, depth, given_colour)
    units = [name for name in kinds if name.endswith("/option/Depth_Units/value")]
    neighbours = [name for name in units if _shared(name, depth) > 2]  # of the same sensor
    read = f"read: depth {depth}, intrinsics {info}, colour {given_colour or NO_COLOUR}"
    return Topics(depth, info, given_colour, neighbours[0] if neighbours else None, (read, *notes))


def _depth_topic(pictures: Sequence[str], kinds: Mapping[str, str]) -> str:
    candidates = [
        name for name in pictures if "depth" in name.lower() and not _has(name, _REGISTERED_COLOUR)
    ]
    if not candidates:
        raise InputError(
            f"no topic with images is named depth; give run.depth=TOPIC of {_listed(kinds)}"
        )
    candidates = [name for name in candidates if _has(name, _REGISTERED_DEPTH)] or candidates
    _require_one_camera(candidates, "run.depth")
    return _first(
        candidates,
        lambda name: (kinds[name] != _IMAGE, "compressedDepth" not in name, len(name)),
        "run.depth",
    )


def _colour_topic(
    pictures: Sequence[str], kinds: Mapping[str, str], depth: str
) -> tuple[str | None, tuple[str, ...]]:
    """Colour in the pixels of depth, or None and a line that says why it is left out."""
    colours = [name for name in pictures if _has(name, _COLOUR) and name != depth]
    moved = [name for name in colours if _has(name, _REGISTERED_COLOUR)]
    colour_topics = [name for name in colours if "depth" not in name.lower()]
    aligned = colour_topics if _has(depth, _REGISTERED_DEPTH) else moved
    camera = _camera(depth)
    below = [name for name in aligned if _camera(name)[: len(camera)] == camera]
    candidates = [name for name in below if _camera(name) == camera] or below
    if not candidates:
        if not colour_topics:
            return None, ()
        return None, (
            f"colour {min(colour_topics, key=len)} is left out, as nothing says that it is "
            f"aligned with {depth}; record depth aligned to colour, or give run.colour=TOPIC if it "
            "is",
        )
    setting = f"run.colour={NO_COLOUR} or run.colour"
    _require_one_camera(candidates, setting)
    is_raw = "image_raw" in depth and "rect" not in depth
    return _first(
        candidates,
        lambda name: (("rect" in name) == is_raw, kinds[name] != _IMAGE, len(name)),
        setting,
    ), ()


def _info_topic(kinds: Mapping[str, str], depth: str, colour: str | None) -> str:
    """Intrinsics beside depth; those of colour if depth is in its pixels and has none of its own.

    Those of the camera's other sensor are never meant.
    """
    sensor, other = ("colour", "depth") if _has(depth, _REGISTERED_DEPTH) else ("depth", "colour")
    sensors = {name: _sensor(name, depth) for name, kind in kinds.items() if kind == _INFO}
    infos = [name for name in sensors if sensors[name] != other]
    place = depth
    candidates = _neighbours(infos, depth, _folder_words(depth, kinds))
    if not candidates and sensor == "colour" and colour is not None:
        place = colour
        candidates = _neighbours(infos, colour, _folder_words(colour, kinds))
    if not candidates:
        place = depth
        infos = [name for name in infos if sensor == "depth" or sensors[name] == sensor]
        candidates = _neighbours(infos, depth, len(_camera(depth)))
    if not candidates:
        raise InputError(
            f"no topic beside {depth} has its intrinsics; give run.info=TOPIC of {_listed(kinds)}"
        )
    return _first(candidates, lambda name: -_shared(name, place), "run.info")


def _sensor(name: str, depth: str) -> str | None:
    """Whose pixels a topic tells of: colour's, those of depth, or None, by what depth lacks."""
    suffix = "/".join(name.split("/")[_shared(name, depth) :])
    is_depth = "depth" in suffix.lower()
    if _has(suffix, _REGISTERED_DEPTH) or (_has(suffix, _COLOUR) and not is_depth):
        return "colour"
    return "depth" if is_depth else None


def _neighbours(names: Sequence[str], topic: str, words: int) -> list[str]:
    """Names that begin with so many words of a topic."""
    return [name for name in names if _shared(name, topic) >= max(words, _MIN_SHARED)]


def _folder_words(topic: str, kinds: Mapping[str, str]) -> int:
    """How many words name the place of images, without how they are compressed."""
    return len(topic.split("/")) - (2 if kinds[topic] == _COMPRESSED else 1)


def _camera(name: str) -> tuple[str, ...]:
    """The words of a topic before the one that names a sensor, which a camera's sensors share."""
    words = name.split("/")
    sensor = (number for number, word in enumerate(words) if _has(word, _SENSOR))
    return tuple(words[: next(sensor, -1)])


def _require_one_camera(names: Sequence[str], setting: str) -> None:
    if len({_camera(name) for name in names}) > 1:
        raise InputError(f"{', '.join(names)} are of several cameras; give {setting}=TOPIC")


def _first(names: Sequence[str], rank: Callable[[str], Any], setting: str) -> str:
    """The name of the lowest rank; raises an InputError if several have it."""
    lowest = min(map(rank, names))
    first, *rivals = [name for name in names if rank(name) == lowest]
    if rivals:
        raise InputError(f"{', '.join([first, *rivals])} fit alike; give {setting}=TOPIC")
    return first


def _has(name: str, words: Sequence[str]) -> bool:
    return any(word in name.lower() for word in words)


def _shared(first: str, second: str) -> int:
    """How many words two topics begin with alike."""
    count = 0
    for a, b in zip(first.split("/"), second.split("/"), strict=False):
        if a != b:
            break
        count += 1
    return count


def _listed(kinds: Mapping[str, str]) -> str:
    useful = (_IMAGE, _COMPRESSED, _INFO)
    names = [f"{name} ({kind})" for name, kind in sorted(kinds.items()) if kind in useful]
    return ", ".join(names) or "no images"
