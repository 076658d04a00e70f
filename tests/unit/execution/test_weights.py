import hashlib

from scenefw.execution.weights import used_weights
from scenefw.learning.checkpoint import shipped_checkpoint

LOADER = "scenefw.learning.checkpoint.load_checkpoint"


def test_every_file_of_weights_that_a_config_loads(tmp_path):
    path = tmp_path / "w.safetensors"
    path.write_bytes(b"weights")
    config = {
        "_target_": "x",
        "a": {"checkpoint": {"_target_": LOADER, "path": str(path)}},
        "b": [{"_target_": LOADER, "path": None, "shipped": "label_maps"}],
        "c": {"_target_": LOADER, "path": str(tmp_path / "missing.safetensors")},
        "d": {"_target_": "other", "path": str(path)},
    }
    shipped = shipped_checkpoint("label_maps").read_bytes()
    assert used_weights({"run": config}) == {
        "w.safetensors": hashlib.sha256(b"weights").hexdigest(),
        "label_maps.safetensors": hashlib.sha256(shipped).hexdigest(),
    }


def test_a_config_without_weights():
    assert used_weights({"run": {"_target_": "x", "checkpoint": None}}) == {}


def test_weights_of_parts_built_later_and_two_files_of_one_name(tmp_path):
    paths = [tmp_path / name / "w.safetensors" for name in ("shipped", "trained")]
    for path in paths:
        path.parent.mkdir()
        path.write_bytes(path.parent.name.encode())
    parts = {path.parent.name: {"_target_": LOADER, "path": str(path)} for path in paths}
    config = {"run": {"_target_": "x", "evaluation": {"_later_": "evaluation.stacks"}}}
    assert used_weights(config | {"evaluation": {"stacks": parts}}) == {
        "w.safetensors": hashlib.sha256(b"shipped").hexdigest(),
        "trained/w.safetensors": hashlib.sha256(b"trained").hexdigest(),
    }
    assert used_weights(config) == {}
