"""Whether values and parts of settings are what components expect, and what to type if not."""

from __future__ import annotations

from typing import TYPE_CHECKING

from scenefw.argument_types import PartError, check_types
from scenefw.core.errors import ConfigError
from scenefw.explanations import settings_of_part

if TYPE_CHECKING:
    from collections.abc import Collection, Mapping, Sequence

    from omegaconf import DictConfig


def require_types(
    settings: DictConfig,
    key: str,
    overrides: Sequence[str],
    options: Mapping[str, Collection[str]],
) -> None:
    """Checks a node before it is built, as `check_types` does.

    Args:
        settings: the whole, as composed.
        key: of the node.
        overrides: as typed.
        options: names of the options of every group.

    Raises:
        ConfigError: a value is of another kind, or a part is none.
    """
    try:
        check_types(settings, key)
    except PartError as error:
        advice = settings_of_part(error.setting, overrides, options)
        raise ConfigError(f"{error}; {advice}") from error
