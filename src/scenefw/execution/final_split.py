"""Which runs may read the final split of the data."""

from __future__ import annotations

from contextlib import AbstractContextManager, nullcontext
from typing import TYPE_CHECKING, Any

from scenefw.core.errors import ConfigError
from scenefw.core.final_split import FINAL, Ledger, opened

if TYPE_CHECKING:
    from omegaconf import DictConfig

_EVALUATE = "scenefw.tasks.evaluate.Evaluate"


def access(config: DictConfig) -> AbstractContextManager[Any]:
    """Opens the final split for a run with `split=final`, and for no other.

    Raises:
        ConfigError: the run is no evaluation, or is not published, so that nothing would count it.
        StorageError: the ledger is damaged.
    """
    if config.get("split") != FINAL:
        return nullcontext()
    if config.run.get("_target_") != _EVALUATE:
        raise ConfigError("split=final is for releases: only run=evaluate may read it")
    if not config.report.get("publish") or not config.report.get("ledger"):
        raise ConfigError(
            "split=final is counted when it is published; give report.publish=FILE, such as "
            "docs/results/final.md, or take split=val or split=test"
        )
    Ledger(config.report.ledger).entries()
    return opened()
