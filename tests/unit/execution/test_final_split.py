"""Which runs may read the final split."""

import pytest
from omegaconf import OmegaConf

from scenefw.core.errors import ConfigError, StorageError
from scenefw.core.final_split import look
from scenefw.execution.final_split import access


def config(split="final", task="evaluate.Evaluate", publish="page.md", ledger="ledger.jsonl"):
    return OmegaConf.create(
        {
            "split": split,
            "run": {"_target_": f"scenefw.tasks.{task}"},
            "report": {"publish": publish, "ledger": ledger},
        }
    )


def test_a_published_evaluation_may(tmp_path):
    with access(config(ledger=str(tmp_path / "ledger.jsonl"))):
        look("stacks", "ab")


@pytest.mark.parametrize("split", ["test", "val"])
def test_other_splits_leave_it_shut(split):
    with access(config(split)), pytest.raises(ConfigError, match="for releases"):
        look("stacks", "ab")


@pytest.mark.parametrize(
    ("settings", "words"),
    [
        ({"publish": None}, "report.publish=FILE"),
        ({"ledger": None}, "report.publish=FILE"),
        ({"task": "train_and_evaluate.TrainAndEvaluate"}, "only run=evaluate"),
        ({"task": "pipeline.Pipeline"}, "only run=evaluate"),
    ],
)
def test_runs_that_nothing_would_count_may_not(settings, words):
    with pytest.raises(ConfigError, match=words):
        access(config(**settings))


def test_a_damaged_ledger_ends_the_run_before_the_work(tmp_path):
    (tmp_path / "ledger.jsonl").write_text("cut off")
    with pytest.raises(StorageError, match="restore it"):
        access(config(ledger=str(tmp_path / "ledger.jsonl")))
