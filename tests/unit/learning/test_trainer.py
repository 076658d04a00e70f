import pytest

from scenefw.learning import trainer
from scenefw.learning.trainer import TrainerSettings


@pytest.mark.parametrize(
    ("precision", "able", "warned"),
    [("bf16-mixed", False, True), ("bf16-mixed", True, False), ("32-true", False, False)],
)
def test_slow_bfloat16_is_told(tmp_path, capsys, monkeypatch, precision, able, warned):
    monkeypatch.setattr(trainer, "_multiplies_bfloat16", lambda: able)
    TrainerSettings(accelerator="cpu", precision=precision).build(tmp_path, [])
    said = capsys.readouterr().err
    assert ("trainer.precision=32-true" in said) == warned
