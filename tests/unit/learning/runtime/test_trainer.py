import pytest
import torch

from scenefw.learning.runtime import trainer
from scenefw.learning.runtime.trainer import TrainerSettings


@pytest.mark.parametrize(
    ("precision", "able", "warned"),
    [("bf16-mixed", False, True), ("bf16-mixed", True, False), ("32-true", False, False)],
)
def test_slow_bfloat16_is_told(tmp_path, capsys, monkeypatch, precision, able, warned):
    monkeypatch.setattr(trainer, "_multiplies_bfloat16", lambda: able)
    TrainerSettings(accelerator="cpu", precision=precision).build(tmp_path, [])
    said = capsys.readouterr().err
    assert ("trainer.precision=32-true" in said) == warned


@pytest.mark.parametrize(("tf32", "within"), [(True, "high"), (False, "highest")])
def test_what_follows_a_training_on_a_gpu_has_full_precision_again(tf32, within):
    settings = TrainerSettings("auto", tf32=tf32)
    before = torch.get_float32_matmul_precision(), torch.backends.cudnn.allow_tf32
    with settings.faster(torch.device("cuda")):
        assert torch.get_float32_matmul_precision() == within
        assert torch.backends.cudnn.allow_tf32 == tf32
    assert (torch.get_float32_matmul_precision(), torch.backends.cudnn.allow_tf32) == before
