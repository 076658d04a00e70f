"""Every experiment, plugins' too, runs to its end at the size of `debug=smoke`."""

import csv
import functools
import json
import os

import numpy as np
import pytest
import trimesh
from plugins.things.tests.images_folder import write_images
from plugins.things.tests.things_folder import write_things

from scenefw import registry
from scenefw.core.geometry import look_at
from scenefw.core.types import Camera, TriangleMesh
from scenefw_annotated_views.silhouettes import SolidViews

# Images of the user, runs of a sweep, weights that don't ship
NEEDS_INPUT = {
    "osd", "realsense_table", "visible_masks", "label_halves", "noise_gathered",
    "label_noise_gathered", "table_5_1_baselines", "real_images", "household", "posed",
}  # fmt: skip
BASELINES = ("fully_convolutional", "sscnet", "unconditional")  # trained for a table of theirs
# Other data, sizes or scales of an experiment that runs; `tests/test_configs.py` composes them
REPEATED = {
    "label_maps_shipped", "label_views_shipped", "thesis/set_autoencoder_of_six",
    "thesis/scenes_of_six",
}  # fmt: skip
# Data that a command makes in an hour
MADE_DATA = {
    name: ["dataset.path=large_stacks_v2"]
    for name in registry.names("experiment")
    if name.startswith("thesis/") and "set" in name
}
NARROW = "model.widths=[8,8,8,8,8]"  # of networks of images, which `debug=smoke` leaves as they are
# What `debug=smoke` leaves of an experiment does some things several times
SMALLER = {
    "complete_scenes": ["~evaluation.parts.of_four_to_eight"],
    "table_6_1": ["~evaluation.parts.of_six"],
    "table_5_1": ["~evaluation.parts.ycb", "~evaluation.parts.stability_superquadrics"],
    "several_views": ["size.several_views=[2]", "~evaluation.methods.optimised"],
    "latent_space": ["evaluation.samples=2", "evaluation.steps=2"],
    "part_affinity": [NARROW],
    "part_images": [NARROW],
}
# Settings of two runs, for experiments whose sweeps are gathered below
SWEEPS = {
    "noise_map": ("noise.gaussian.sigma=0.0", "size.frames=1", "noise.pose.sigma=0.0,0.01"),
}


@pytest.fixture(scope="module")
def sweep(warm, tmp_path_factory):
    """Makes the runs of an experiment once: what it printed, and their folders `0`, `1`."""

    @functools.cache
    def made(name):
        folder = tmp_path_factory.mktemp("sweep")
        words = ("-m", f"experiment={name}", "debug=smoke", *SWEEPS[name], f"paths.output={folder}")
        done = warm("scenefw", words, folder, dict(os.environ))
        assert done.returncode == 0, done.stderr[-3000:]
        return done.stdout, folder

    return made


def experiments():
    """All that need no input; two of them in every `make test`."""
    trained = {f"thesis/{name}" for name in BASELINES}
    for name in registry.names("experiment"):
        if name not in NEEDS_INPUT | REPEATED | trained:
            rest = () if name in {"simstack", "labelling"} else pytest.mark.exhaustive
            yield pytest.param(name, marks=rest)


@pytest.mark.parametrize("name", experiments())
def test_experiment_runs(scenefw, sweep, tmp_path, name):
    if name in SWEEPS:
        said, folder = sweep(name)
        out = folder / "0"
        assert str(out) in said.splitlines()
    else:
        out = tmp_path / "out"
        own = [*MADE_DATA.get(name, []), *SMALLER.get(name, [])]
        if name == "part_images":
            own += [f"paths.images={write_images(tmp_path / 'images')}"]
        if name == "object_shells":
            own += [f"paths.images={write_things(tmp_path)}"]
        done = scenefw(f"experiment={name}", "debug=smoke", f"paths.output={out}", *own)
        assert done.returncode == 0, done.stderr[-3000:]
        assert done.stdout.strip().splitlines()[-1] == str(out)
    figures = json.loads((out / "metrics.json").read_text())
    assert figures
    assert all(isinstance(value, int | float) for value in figures.values())
    assert (out / "config.yaml").exists()
    assert (out / "run.json").exists()


@pytest.mark.exhaustive
def test_fused_maps_are_packed_and_trained_on(scenefw, tmp_path):
    words = ("debug=smoke", "paths.output=out")
    pack = ("experiment=label_maps", "run=pack_maps", "dataset=tabletop_fused_maps")
    done = scenefw(*words, *pack, "parallel.workers=1")
    assert done.returncode == 0, done.stderr[-3000:]
    assert "train: 2 of 2 maps" in done.stdout
    done = scenefw(*words, "experiment=label_maps", "dataset=tabletop_fused_maps_packed")
    assert done.returncode == 0, done.stderr[-3000:]
    assert json.loads((tmp_path / "out" / "metrics.json").read_text())["train/steps"] == 2


@pytest.mark.exhaustive
def test_a_sweep_of_noise_becomes_one_map(scenefw, sweep, tmp_path):
    _, folder = sweep("noise_map")
    done = scenefw("experiment=noise_gathered", f"input={folder}", "paths.output=out")
    assert done.returncode == 0, done.stderr[-3000:]
    figures = json.loads((tmp_path / "out" / "metrics.json").read_text())
    for name in ("view_based", "map_based", "hybrid"):
        assert {f"{name}/pose {p} mm, depth 0 mm" for p in (0, 10)} <= figures.keys()
    done = scenefw("experiment=label_noise_gathered", f"input={folder}", "paths.output=rows")
    assert done.returncode == 0, done.stderr[-3000:]
    rows = json.loads((tmp_path / "rows" / "metrics.json").read_text())
    exact = figures["hybrid/pose 0 mm, depth 0 mm"]
    assert rows["noise.pose.sigma=0.0/hybrid/pose 0 mm, depth 0 mm"] == pytest.approx(exact)
    assert not any(name.startswith("noise.pose.sigma=0.01") for name in rows)  # no column


@pytest.mark.exhaustive
def test_a_sweep_of_trainings_becomes_one_table(scenefw, tmp_path):
    words = ("experiment=object_count", "run=train_and_evaluate", "debug=smoke")
    done = scenefw("-m", *words, "model.width=8,4", "paths.output=sweep")
    assert done.returncode == 0, done.stderr[-3000:]
    done = scenefw("run=collect", "input=sweep", "paths.output=out")
    assert done.returncode == 0, done.stderr[-3000:]
    figures = json.loads((tmp_path / "out" / "metrics.json").read_text())
    sizes = [figures[f"model.width={width}/train/parameters"] for width in (8, 4)]
    assert sizes[0] > sizes[1]


@pytest.mark.exhaustive
def test_runs_of_a_sweep_begin_with_the_weights_of_their_seed(scenefw, tmp_path):
    words = ("run=train", "debug=smoke", "paths.training=${paths.output}/training")
    done = scenefw("-m", *words, "seed=0,1", "run.log_every=1,2", "paths.output=sweep")
    assert done.returncode == 0, done.stderr[-3000:]
    tables = []
    for number in range(4):
        with (tmp_path / "sweep" / str(number) / "losses.csv").open(newline="") as file:
            values = {row["name"]: float(row["value"]) for row in csv.DictReader(file)}
        tables.append([values["val/tsdf"], values["val/vote_degrees"]])
    # Sums of several threads differ in their last bits, other weights in the first digits.
    assert tables[0] == pytest.approx(tables[1], rel=1e-3)
    assert tables[2] == pytest.approx(tables[3], rel=1e-3)
    assert tables[0] != pytest.approx(tables[2], rel=2e-2)


@pytest.mark.exhaustive
def test_baselines_are_trained_and_stand_in_table_5_1(scenefw, tmp_path):
    words, files = ("debug=smoke", "size.resolution=32"), []
    for name in BASELINES:
        out = f"paths.output={name}"
        done = scenefw(f"experiment=thesis/{name}", *words, out)
        assert done.returncode == 0, done.stderr[-3000:]
        assert json.loads((tmp_path / name / "metrics.json").read_text())["train/steps"] == 2
        files.append(f"checkpoints.{name}={tmp_path / name / f'thesis_{name}.safetensors'}")
    left_out = ("ycb", "stability_ycb", "stability_superquadrics")
    rest = [f"~evaluation.parts.{name}" for name in left_out]
    words = ("experiment=table_5_1_baselines", "debug=smoke", *rest, *files)
    done = scenefw(*words, "paths.output=out")
    assert done.returncode == 0, done.stderr[-3000:]
    figures = json.loads((tmp_path / "out" / "metrics.json").read_text())
    for name in BASELINES:
        assert any(f"/{name}/" in key for key in figures), (name, list(figures)[:20])


def test_baselines_without_weights_say_what_they_need(scenefw):
    done = scenefw("experiment=table_5_1_baselines", "debug=smoke")
    assert done.returncode == 2, done.stderr[-3000:]
    assert "checkpoints.fully_convolutional = null: expected a file" in done.stderr


@pytest.mark.parametrize("name", ["osd", "household", "posed"])
def test_labelled_images_without_a_folder_say_what_they_need(scenefw, name):
    done = scenefw(f"experiment={name}", "debug=smoke")
    assert done.returncode == 2, done.stderr[-3000:]
    assert "input=FOLDER" in done.stderr


@pytest.mark.exhaustive
def test_things_are_scored_with_noise_of_each_sensor(scenefw, tmp_path):
    folder = tmp_path / "meshes" / "ycb_video_frame"
    folder.mkdir(parents=True)
    trimesh.creation.box((0.06, 0.09, 0.12)).export(folder / "box.ply")
    trimesh.creation.cylinder(0.035, 0.1).export(folder / "can.ply")
    words = ("experiment=household", "debug=smoke", "split=val", "input=meshes", "paths.output=out")
    sensors = ("kinect", "none")
    others = ("stereo_ramps", "time_of_flight", "phone_lidar")
    left_out = [f"{group}.{sensor}" for group in ("few", "many") for sensor in others]
    one_is_enough = (f"~evaluation.strata.{name}" for name in (*left_out, "many.none"))
    quick = ("evaluation.steps=100", "shared.many.source.maximum=6")
    hulls = "evaluation.bodies.parts.convex=0.0"  # CoACD would take a minute
    done = scenefw(*words, *one_is_enough, *quick, hulls)
    assert done.returncode == 0, done.stderr[-3000:]
    figures = json.loads((tmp_path / "out" / "metrics.json").read_text())
    for group, most in ({f"few/{sensor}": 4 for sensor in sensors} | {"many/kinect": 6}).items():
        assert figures[f"{group}/images"] == 1
        assert 0 < figures[f"{group}/objects"] <= most
        for method in ("set_extents", "hull", "mirrored"):
            assert f"{group}/true_masks/{method}/iou" in figures
    (tmp_path / "empty").mkdir()
    done = scenefw(*words[:3], "input=empty", "paths.output=out2")
    assert done.returncode == 2
    assert "holds no folder ycb_video_frame of meshes" in done.stderr


@pytest.mark.exhaustive
def test_posed_images_are_scored(scenefw, tmp_path):
    folder = tmp_path / "posed"
    for name in ("images", "meshes"):
        (folder / name).mkdir(parents=True)
    box = trimesh.creation.box((0.1, 0.08, 0.12))
    box.export(folder / "meshes" / "box.ply")
    camera = Camera(160, 120, 145, 145, 79.5, 59.5, look_at((0.0, -0.6, 0.5), (0.0, 0.0, 0.0)))
    mesh = TriangleMesh(np.asarray(box.vertices) + (0, 0, 0.06), np.asarray(box.faces))
    depth, (silhouette,) = SolidViews([mesh]).see(camera)
    pose = np.eye(4)
    pose[2, 3] = 0.06
    np.savez(
        folder / "images" / "a.npz", depth=depth, K=camera.matrix, obj_names=np.array(["box"]),
        T_cam_obj=(np.linalg.inv(camera.T_world_camera) @ pose)[None],
        instances=silhouette.visible.astype(np.int16),
    )  # fmt: skip
    done = scenefw("experiment=posed", "input=posed", "size.draws=2", "paths.output=out")
    assert done.returncode == 0, done.stderr[-3000:]
    figures = json.loads((tmp_path / "out" / "metrics.json").read_text())
    assert figures["posed/images/true_masks/set_extents/iou"] > 0.8  # exact depth of a box
    assert figures["posed/images/true_masks/hull/iou"] > 0.4


@pytest.mark.exhaustive
def test_an_exported_data_set_is_scored(scenefw, tmp_path):
    words = ("debug=smoke", "views=stacks", "format=bop", "split=test", "paths.output=stacks")
    done = scenefw("run=export_dataset", *words)
    assert done.returncode == 0, done.stderr[-3000:]
    words = ("debug=smoke", f"input={tmp_path / 'stacks'}", "paths.output=out")
    done = scenefw("experiment=visible_masks", *words)
    assert done.returncode == 0, done.stderr[-3000:]
    figures = json.loads((tmp_path / "out" / "metrics.json").read_text())
    assert figures["overlap_f"] > 0.8  # images without noise


@pytest.mark.exhaustive
def test_a_network_of_sets_predicts_what_it_was_trained_for(scenefw, tmp_path):
    words = ("experiment=decomposition", "debug=smoke")
    done = scenefw(*words, "run=train", "paths.output=trained")
    assert done.returncode == 0, done.stderr[-3000:]
    depth = np.full((60, 80), 0.8)
    depth[20:40, 20:40] = 0.7
    np.savez(tmp_path / "block.npz", depth=depth, K=[[75, 0, 39.5], [0, 75, 29.5], [0, 0, 1]])
    weights = tmp_path / "trained" / "decomposition.safetensors"
    given = (f"checkpoint={weights}", f"input={tmp_path / 'block.npz'}", "paths.output=out")
    done = scenefw(*words, "run=predict", *given)
    assert done.returncode == 0, done.stderr[-3000:]
    scene = json.loads((tmp_path / "out" / "block" / "scene.json").read_text())
    trained = json.loads((tmp_path / "trained" / "metrics.json").read_text())
    assert scene["checkpoint"]["steps"] == trained["train/steps"]
    done = scenefw(*words, "run=predict", given[1])
    assert done.returncode == 2
    assert "checkpoint = null: expected a file" in done.stderr
