"""Bags of a few images, written by rosbags for the tests."""

import io
import struct

import numpy as np
import pytest
from PIL import Image

rosbag2 = pytest.importorskip("rosbags.rosbag2")
from rosbags.rosbag1 import Writer as OldWriter  # noqa: E402
from rosbags.typesys import Stores, get_typestore  # noqa: E402

K = np.array([[60.0, 0, 19.5], [0, 61.0, 14.5], [0, 0, 1]])
DEPTH = np.random.default_rng(0).integers(400, 2000, (30, 40)).astype(np.uint16)
COLOUR = np.random.default_rng(1).integers(0, 256, (30, 40, 3)).astype(np.uint8)
CAMERA = "/camera/aligned_depth_to_color"


class Store:
    """Messages of one version of ROS."""

    def __init__(self, old):
        self.old = old
        self.types = get_typestore(Stores.ROS1_NOETIC if old else Stores.ROS2_HUMBLE)

    def of(self, name, **values):
        return self.types.types[name](**values)

    def header(self, time=0):
        stamp = self.of("builtin_interfaces/msg/Time", sec=time, nanosec=0)
        extra = {"seq": 0} if self.old else {}
        return self.of("std_msgs/msg/Header", stamp=stamp, frame_id="camera", **extra)

    def image(self, pixels, encoding, padding=0, big=False):
        rows = pixels.reshape(len(pixels), -1)
        rows = rows.astype(rows.dtype.newbyteorder(">" if big else "<"))
        data = np.ascontiguousarray(rows).view(np.uint8).reshape(len(pixels), -1)
        data = np.pad(data, ((0, 0), (0, padding)), constant_values=7)
        return self.of(
            "sensor_msgs/msg/Image", header=self.header(), height=len(pixels),
            width=pixels.shape[1], encoding=encoding, is_bigendian=int(big), step=data.shape[1],
            data=data.ravel(),
        )  # fmt: skip

    def compressed(self, data, form):
        return self.of(
            "sensor_msgs/msg/CompressedImage", header=self.header(), format=form,
            data=np.frombuffer(data, np.uint8),
        )  # fmt: skip

    def info(
        self, model="plumb_bob", coefficients=(0,) * 5, projection=(0,) * 12, matrix=K,
        size=(40, 30), region=(0, 0, 0, 0), binning=0,
    ):  # fmt: skip
        names = ("x_offset", "y_offset", "width", "height")
        roi = self.of(
            "sensor_msgs/msg/RegionOfInterest", **dict(zip(names, region, strict=True)),
            do_rectify=False,
        )  # fmt: skip
        names = "DKRP" if self.old else "dkrp"
        values = (
            np.array(coefficients, float),
            matrix.ravel(),
            np.eye(3).ravel(),
            np.array(projection, float),
        )
        return self.of(
            "sensor_msgs/msg/CameraInfo", header=self.header(), height=size[1],
            width=size[0], distortion_model=model, binning_x=binning, binning_y=binning, roi=roi,
            **dict(zip(names, values, strict=True)),
        )  # fmt: skip

    def number(self, value):
        return self.of("std_msgs/msg/Float32", data=value)


def written(path, messages, old=False):
    """A bag of (topic, seconds, function of the store)."""
    store = Store(old)
    writer = OldWriter(path) if old else rosbag2.Writer(path, version=9)
    with writer:
        connections = {}
        for topic, seconds, make in messages:
            message = make(store)
            kind = message.__msgtype__
            if topic not in connections:
                connections[topic] = writer.add_connection(topic, kind, typestore=store.types)
            serialise = store.types.serialize_ros1 if old else store.types.serialize_cdr
            writer.write(connections[topic], int(seconds * 1e9), serialise(message, kind))
    return path


def recording(depth=DEPTH, encoding="16UC1", **options):
    return [
        (f"{CAMERA}/camera_info", 0.5, lambda s: s.info()),
        ("/camera/color/image_raw", 1, lambda s: s.image(COLOUR, "rgb8", padding=5)),
        (f"{CAMERA}/image_raw", 1.1, lambda s: s.image(depth, encoding, **options)),
        (f"{CAMERA}/image_raw", 2, lambda s: s.image(depth + 1, encoding, **options)),
        (f"{CAMERA}/image_raw", 3, lambda s: s.image(depth + 2, encoding, **options)),
        ("/camera/color/image_raw", 2.1, lambda s: s.image(COLOUR, "rgb8")),
        ("/camera/color/image_raw", 3.1, lambda s: s.image(COLOUR, "rgb8")),
    ]


def shades(times, depth_times, depth=DEPTH):
    """A recording whose n-th colour image is of the value n."""
    return [
        (f"{CAMERA}/camera_info", 0, lambda s: s.info()),
        *(
            ("/camera/color/image_raw", t, lambda s, n=n: s.image(COLOUR * 0 + n, "rgb8"))
            for n, t in enumerate(times)
        ),
        *((f"{CAMERA}/image_raw", t, lambda s: s.image(depth, "16UC1")) for t in depth_times),
    ]  # fmt: skip


def compressed(form, data, colour=False):
    return [
        ("/depth_registered/camera_info", 0, lambda s: s.info()),
        *([("/rgb/image_raw", 1, lambda s: s.image(COLOUR, "rgb8"))] if colour else []),
        ("/depth_registered/image_raw/compressedDepth", 2, lambda s: s.compressed(data, form)),
    ]


def png_of(pixels):
    data = io.BytesIO()
    Image.fromarray(pixels).save(data, "png")
    return data.getvalue()


def rvl_of(pixels):
    """The published encoder, number by number."""
    nibbles, values, place, previous = [], pixels.ravel().tolist(), 0, 0

    def put(number):
        while True:
            nibble, number = number & 7, number >> 3
            nibbles.append(nibble | (8 if number else 0))
            if not number:
                return

    while place < len(values):
        zeros = next((n for n, v in enumerate(values[place:]) if v), len(values) - place)
        place += zeros
        nonzeros = next((n for n, v in enumerate(values[place:]) if not v), len(values) - place)
        put(zeros)
        put(nonzeros)
        for value in values[place : place + nonzeros]:
            delta, previous = value - previous, value
            put((delta << 1) ^ (delta >> 31))
        place += nonzeros
    nibbles += [0] * (-len(nibbles) % 8)
    words = [
        int("".join(f"{n:x}" for n in nibbles[k : k + 8]), 16) for k in range(0, len(nibbles), 8)
    ]
    return struct.pack("<II", pixels.shape[1], pixels.shape[0]) + struct.pack(
        f"<{len(words)}I", *words
    )


HOLES = np.where(np.random.default_rng(2).random(DEPTH.shape) < 0.3, 0, DEPTH).astype(np.uint16)
A, B = 4000.0, 2.0  # of inverted depth
INVERSE = np.rint(A / (np.where(HOLES, HOLES, 1) / 1000) + B).astype(np.uint16) * (HOLES > 0)
HEADER = struct.pack("<iff", 0, A, B)
