"""Composed settings: checked as those of a command, and built part by part."""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import AbstractContextManager
from typing import Any

from scenefw import config, plugins, registry
from scenefw.command_words import with_homes
from scenefw.core.cache_folder import share_with_matplotlib
from scenefw.core.errors import ConfigError, SceneFWError
from scenefw.execution.build import Builder
from scenefw.execution.modifiers import make_deterministic
from scenefw.execution.parts import require_types
from scenefw.execution.places import require_values
from scenefw.execution.reads import require_read
from scenefw.execution.run import pick_device, require_seed
from scenefw.execution.threads import require_threads, threads
from scenefw.explanations import explain


class Settings:
    """What a command with these overrides would work with.

    Args:
        words: overrides as on the command line.

    Raises:
        ConfigError: a word is wrong, or nothing that is built reads it.
    """

    def __init__(self, words: Sequence[str]) -> None:
        self.words = with_homes(words)
        require_values(self.words)
        share_with_matplotlib()
        plugins.activate()
        try:
            self.config = config.compose(self.words)
        except ConfigError as error:
            raise self._explained(error) from error
        require_seed(self.config.seed)
        require_threads(self.config.threads)
        self.config.device = pick_device(self.config.device)

    def build(self, *keys: str) -> list[Any]:
        """The objects of nodes; parts that several refer to are built once.

        Raises:
            ConfigError: a setting is wrong, or none of these nodes reads it.
            SceneFWError: as a component raises it.
        """
        try:
            options = registry.catalogue()
            require_read(self.config, self.words, options, keys=keys)
            for key in keys:
                require_types(self.config, key, self.words, options)
            if self.config.deterministic:
                make_deterministic()
            builder = Builder(self.config)
            return [builder.build(key) for key in keys]
        except SceneFWError:
            raise
        except Exception as error:
            if type(error).__module__.startswith(("hydra.", "omegaconf.")):
                raise self._explained(error) from error
            raise

    def computing(self) -> AbstractContextManager[None]:
        """Within it, threads compute and wait as the settings say."""
        return threads(self.config.threads, yields=self.config.yielding)

    def _explained(self, error: Exception) -> ConfigError:
        options = {group: sorted(names) for group, names in registry.catalogue().items()}
        return explain(error, self.words, options)
