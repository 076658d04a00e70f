"""What the service answers about usable images."""

import io
import zipfile

import numpy as np
import trimesh
from PIL import Image
from plugins.serving.tests.services import FRAME, GRID, depth_png, error_of, intrinsics, npz, png
from tests.unit.perception.pipelines import KnownBoxes, pipeline_of

from scenefw_serving.limits import Limits
from scenefw_serving.uploads import Part, Upload


def test_an_npz_gives_the_scene_that_a_prediction_gives(client):
    answer = client.post("/reconstruct", content=npz())
    assert answer.status_code == 200
    assert answer.headers["content-type"] == "application/json"
    scene = answer.json()
    direct = pipeline_of(KnownBoxes(GRID), samples=2)(FRAME)[0]
    assert [item["id"] for item in scene["objects"]] == [1, 2]
    centres = [item["centre"] for item in scene["objects"]]
    np.testing.assert_allclose(centres, [o.pose.position for o in direct.objects], atol=1e-4)


def test_a_png_with_intrinsics_and_colour_gives_the_same(client):
    files = {
        "depth": ("table.png", depth_png()),
        "intrinsics": ("camera.json", intrinsics()),
        "colour": ("table.jpg", png(np.full((120, 160, 3), 99, np.uint8))),
    }
    scene = client.post("/reconstruct", files=files).json()
    assert scene["name"] == "table"
    other = client.post("/reconstruct", content=npz()).json()
    for item, same in zip(scene["objects"], other["objects"], strict=True):
        np.testing.assert_allclose(item["centre"], same["centre"], atol=2e-3)


def test_the_scene_comes_as_glb_masks_and_zip(client):
    glb = client.post("/reconstruct?format=glb", content=npz())
    assert glb.headers["content-type"] == "model/gltf-binary"
    meshes = trimesh.load(io.BytesIO(glb.content), file_type="glb").geometry
    assert sorted(meshes) == ["object_01", "object_02"]
    masks = client.post("/reconstruct?format=masks", content=npz())
    ids = np.array(Image.open(io.BytesIO(masks.content)))
    assert ids.shape == (120, 160)
    assert set(np.unique(ids)) == {0, 1, 2}
    packed = client.post("/reconstruct?format=zip", content=npz())
    names = zipfile.ZipFile(io.BytesIO(packed.content)).namelist()
    files = {"scene.json", "scene.glb", "masks.png", "object_01.ply", "object_02.ply"}
    assert files | {f"hypothesis_2/{name}" for name in files} <= set(names)


def test_one_image_is_predicted_once(service):
    client, running = service
    completion = running.predictions.pipeline.completion
    image = npz(depth=FRAME.depth + np.float32(1e-4))
    before = len(completion.requests)
    for form in ("json", "glb", "masks", "zip"):
        assert client.post(f"/reconstruct?format={form}", content=image).status_code == 200
    assert len(completion.requests) == before + 1


def test_remembered_images_are_bounded(service):
    predictions = service[1].predictions
    for shift in range(6):
        service[0].post("/reconstruct", content=npz(depth=FRAME.depth + np.float32(1e-3 * shift)))
    assert len(predictions._scenes) <= predictions.remembered


def test_another_hypothesis_can_be_asked_for(client):
    answer = client.post("/reconstruct?sample=1", content=npz())
    assert answer.status_code == 200
    refused = client.post("/reconstruct?sample=2", content=npz())
    assert refused.status_code == 422
    assert error_of(refused) == "there is no sample 2; give one of 0 to 1"


def test_doctor_and_settle_answer(client):
    report = client.post("/doctor", content=npz()).json()
    assert report["usable"]
    assert {"unit", "floor", "tilt"} <= {check["name"] for check in report["checks"]}
    odd = client.post("/doctor", content=npz(depth=1000 * FRAME.depth))
    assert odd.status_code in (200, 422)
    assert "settled" in client.post("/settle", content=npz()).json()
    views = client.post("/next_view", content=npz()).json()["views"]
    assert [set(view) for view in views] == [{"T_world_camera", "score"}] * 2


def test_answers_are_in_the_base_of_a_robot_if_the_cameras_pose_is_said(client):
    pose = np.diag([1.0, -1.0, -1.0, 1.0])
    pose[:3, 3] = 0.3, 0.1, 1.2
    files = {"depth": ("a.npz", npz()), "camera_pose": ("pose.json", str(pose.tolist()).encode())}
    here = client.post("/reconstruct", files={"depth": ("a.npz", npz())}).json()
    base = client.post("/reconstruct", files=files).json()
    assert base["camera"]["T_world_camera"] == pose.tolist()
    motion = pose @ np.linalg.inv(here["camera"]["T_world_camera"])
    np.testing.assert_allclose(base["T_base_floor"], motion, atol=1e-9)
    for before, after in zip(here["objects"], base["objects"], strict=True):
        expected = motion @ [*before["centre"], 1.0]
        np.testing.assert_allclose(after["centre"], expected[:3], atol=1e-9)
    wrong = client.post("/reconstruct", files={**files, "camera_pose": b"[1, 2]"})
    assert wrong.status_code == 422
    assert "camera_pose" in error_of(wrong)


def test_masks_with_scores_say_which_object_a_pixel_shows(client):
    ids = FRAME.labels
    masks = np.stack([ids > 0, ids == 2, ids == 1])
    image = npz(masks=masks, scores=[0.2, 0.9, 0.8])
    scene = client.post("/reconstruct", content=image).json()
    plain = client.post("/reconstruct", content=npz()).json()
    assert len(scene["objects"]) == len(plain["objects"])
    files = [
        ("masks", (f"{i}.png", png(mask.astype(np.uint8) * 255))) for i, mask in enumerate(masks)
    ]
    files += [
        ("depth", ("table.png", depth_png())),
        ("intrinsics", ("camera.json", intrinsics())),
        ("scores", ("scores.json", b"[0.2, 0.9, 0.8]")),
    ]
    assert client.post("/reconstruct", files=files).status_code == 200


def test_masks_that_vanish_are_told_and_the_others_keep_their_ids(client):
    mask = (FRAME.labels == 2).astype(np.uint8) * 255
    parts = [("masks", (f"{n}.png", png(part))) for n, part in enumerate((0 * mask, mask, mask))]
    scene = client.post("/reconstruct", files=[("depth", ("a.npz", npz())), *parts]).json()
    lines = [line for line in scene["warnings"] if "of the masks is left out" in line]
    assert [line.split(" of ")[0] for line in lines] == ["object 1", "object 2"]
    parts = {"depth": [Part(npz())], "masks": [Part(data) for _, (_, data) in parts]}
    _, ids, _ = Upload(parts).read(Limits())
    np.testing.assert_array_equal(ids, np.where(mask, 3, 0))
    assert ids.dtype == np.int32


def test_openapi_and_the_page_tell_all_routes(client):
    schema = client.get("/openapi.json").json()
    paths = {"/reconstruct", "/settle", "/doctor", "/next_view", "/slow", "/health"}
    assert paths == set(schema["paths"])
    page = client.get("/").text
    assert "POST /reconstruct" in page
    assert "http" not in page.replace("<!doctype html>", "")  # nothing is fetched from elsewhere
