"""What the service refuses, each time in one line."""

import io
import re

import numpy as np
import pytest
from PIL import Image
from plugins.serving.tests.services import FRAME, depth_png, error_of, intrinsics, npz, png, serving

from scenefw_serving.limits import Limits


def npz_without_intrinsics():
    file = io.BytesIO()
    np.savez_compressed(file, depth=FRAME.depth)
    return file.getvalue()


@pytest.mark.parametrize(
    ("files", "words"),
    [
        ({"depth": ("a.png", depth_png())}, "no intrinsics"),
        ({"intrinsics": ("a.json", intrinsics())}, "no depth image"),
        ({"depth": ("a.npz", npz()), "dept": b"x"}, "no field dept"),
        ({"depth": ("a.txt", b"hello")}, "depth is no .npz, .npy or .png"),
        ({"depth": ("a.npz", b"PK\x03\x04broken")}, "cannot read a.npz"),
        ({"depth": ("a.npz", npz(depth=FRAME.depth * 0))}, "no measurements"),
        ({"depth": ("a.npz", npz(depth=FRAME.depth[0]))}, "shape"),
        (
            {"depth": ("a.npz", npz(depth=FRAME.depth * 1000))},
            "in metres; multiply it by 0.001",
        ),
        ({"depth": ("a.npz", npz_without_intrinsics())}, "store them in it or give intrinsics"),
        ({"depth": ("a.npz", npz()), "scores": b"[1]"}, "no masks"),
        ({"depth": ("a.npz", npz(masks=np.ones((2, 120, 160)), scores=[1]))}, "scores have shape"),
        ({"depth": ("a.npz", npz(masks=np.ones((2, 12, 16))))}, "same size"),
        (
            {"depth": ("a.png", depth_png()), "intrinsics": ("a.json", b"{}")},
            "fx",
        ),
    ],
)
def test_unusable_images_are_422_in_one_line(client, files, words):
    answer = client.post("/reconstruct", files=files)
    assert answer.status_code == 422
    assert words in error_of(answer)
    assert "/tmp" not in error_of(answer)
    assert "run." not in error_of(answer)


def test_colour_of_another_size_is_refused(client):
    files = {
        "depth": ("table.png", depth_png()),
        "intrinsics": ("camera.json", intrinsics()),
        "colour": ("table.png", png(np.zeros((60, 80, 3), np.uint8))),
    }
    answer = client.post("/reconstruct", files=files)
    assert answer.status_code == 422
    assert "80 x 60 pixels, depth 160 x 120" in error_of(answer)


@pytest.mark.parametrize(("name", "key"), [("colour", "rgb"), ("masks", "masks")])
def test_what_comes_twice_is_refused(client, name, key):
    picture = np.zeros((*FRAME.depth.shape, 3), np.uint8)
    array = picture if key == "rgb" else picture[None, ..., 0]
    files = {"depth": ("table.npz", npz(**{key: array})), name: ("other.png", png(picture))}
    answer = client.post("/reconstruct", files=files)
    assert answer.status_code == 422
    assert f"{name} comes twice" in error_of(answer)


def picture(kind, *masks, **options):
    first, *others = [Image.fromarray(mask) for mask in masks]
    file = io.BytesIO()
    more = {"save_all": True, "append_images": others} if others else {}
    first.save(file, kind, **more, **options)
    return file.getvalue()


def test_masks_are_refused_that_show_no_sharp_object(client):
    mask = (FRAME.labels == 2).astype(np.uint8) * 255
    soft = np.array(Image.fromarray(mask).resize((40, 30)).resize((160, 120)))
    for name, data, words in (
        ("soft.png", png(soft), "soft"),
        ("a.jpg", picture("JPEG", mask, quality=60), "mask of a|mask a has several values"),
        ("two.png", picture("PNG", mask, mask.T.reshape(mask.shape)), "holds 2 pictures"),
        ("colour.png", png(np.stack([mask] * 3, axis=-1)), "mode RGB"),
        ("cut.png", png(mask)[:-40], "cannot read mask"),
    ):
        answer = client.post(
            "/reconstruct", files=[("depth", ("a.npz", npz())), ("masks", (name, data))]
        )
        assert answer.status_code == 422
        assert re.search(words, error_of(answer))
        assert "/tmp" not in error_of(answer)


def test_parameters_that_fit_nothing_are_one_line(client):
    for words in ("format=stl", "sample=many", "depth_scale=-1"):
        answer = client.post(f"/reconstruct?{words}", content=npz())
        assert answer.status_code == 422
        assert words.split("=", maxsplit=1)[0] in error_of(answer)
    assert client.post("/nowhere").status_code == 404
    assert client.get("/reconstruct").status_code == 405


@pytest.mark.parametrize("path", ["/reconstruct", "/doctor", "/slow"])
def test_a_misspelt_parameter_is_refused_with_the_near_ones(client, path):
    answer = client.post(f"{path}?smaple=1", content=npz())
    assert answer.status_code == 422
    assert error_of(answer) == "no parameter smaple; did you mean sample?"
    unlike = error_of(client.post(f"{path}?x=1&sample=0", content=npz()))
    assert unlike == "no parameter x; there are depth_scale, format, sample"
    assert error_of(client.get("/health?sample=1")) == "no parameter sample; there are none"


def test_pages_of_other_servers_are_refused(client):
    assert client.get("/health", headers={"host": "evil.example"}).status_code == 403
    answer = client.post("/doctor", content=npz(), headers={"origin": "http://evil.example"})
    assert answer.status_code == 403
    own = {"origin": str(client.base_url).rstrip("/")}
    assert client.post("/doctor", content=npz(), headers=own).status_code == 200


def test_what_is_too_large_is_refused_unread():
    with serving(Limits(body=0.2, pixels=0.02, masks=2)) as (client, service):
        answer = client.post("/reconstruct", content=b"PK\x03\x04" + bytes(300_000))
        assert answer.status_code == 413
        assert "0.2 MB" in error_of(answer)

        def chunks():
            yield b"PK\x03\x04"
            for _ in range(100):
                yield bytes(10_000)

        unsaid = client.post("/reconstruct", content=chunks())  # no Content-Length
        assert unsaid.status_code == 413
        wide = client.post("/reconstruct", content=npz(depth=np.ones((200, 200))))
        assert wide.status_code == 413
        bomb = client.post("/reconstruct", content=npz(depth=np.zeros((1000, 1000))))
        assert bomb.status_code == 413
        assert "unpacks to" in error_of(bomb)
        masks = client.post("/reconstruct", content=npz(masks=np.ones((3, 120, 160), bool)))
        assert masks.status_code == 413
        picture = {"depth": ("a.png", png(np.ones((200, 200), np.uint16))), "intrinsics": b"{}"}
        assert client.post("/reconstruct", files=picture).status_code == 413
        assert client.post("/reconstruct", content=npz()).status_code == 200
        assert service.waiting == 0
