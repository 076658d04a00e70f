"""`scenefw.load`: builds a predictor from the configs that the command line uses."""

from __future__ import annotations

import importlib
import re
import warnings
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal, overload

from scenefw import plugins
from scenefw.api.settings import Settings
from scenefw.config import near_misses, package_dir, quoted
from scenefw.core.errors import ConfigError

if TYPE_CHECKING:
    from scenefw.api.labeller import Labeller
    from scenefw.api.predictor import Predictor

_PLAIN = re.compile(r"[A-Za-z_][\w./-]*", re.ASCII)
_NO_TEXT = {"null", "true", "false", "inf", "nan"}

Setting = str | int | float | bool | Path | None | list[Any] | tuple[Any, ...]


@overload
def load(
    name: Literal["reconstruction", "simstack"] = "reconstruction",
    *overrides: str,
    **settings: Setting,
) -> Predictor: ...


@overload
def load(name: Literal["labelling"], *overrides: str, **settings: Setting) -> Labeller: ...


@overload
def load(name: str, *overrides: str, **settings: Setting) -> Any: ...


def load(name: str = "reconstruction", *overrides: str, **settings: Setting) -> Any:
    """What the command line predicts, labels or draws with, ready to take arrays.

    It is built as `run=predict` and `run=label` build it, so the same image gives the same result.
    Plugins add names (`decomposing`, as `run=decompose`; `scenes`, as `run=draw_scenes`).

    Args:
        name: `reconstruction` completes the objects of a depth image; `labelling` fuses RGB-D
            frames into a labelled height map; other names are of plugins.
        overrides: as on the command line, such as `"segmentation=creases"`
            or `"reconstructor.samples=1"`.
        settings: the same by name, such as `device="cpu"` or `checkpoint="my.safetensors"`.

    Raises:
        ConfigError: no such name, option or setting, or one that changes nothing.
        CheckpointError: weights are missing or damaged.
    """
    for word in (name, *overrides):
        if not isinstance(word, str):
            raise ConfigError(
                f"scenefw.load takes words, got {word!r} ({type(word).__name__}); give a name and "
                'settings, such as scenefw.load("reconstruction", device="cpu")'
            )
    words = [*overrides, *(f"{key}={_override_value(value)}" for key, value in settings.items())]
    if name == "simstack":
        warnings.warn(
            'scenefw.load("simstack") doesn\'t use the network SIMstack; it is called '
            'scenefw.load("reconstruction") now',
            FutureWarning,
            stacklevel=2,
        )
        name = "reconstruction"
    if name == "reconstruction":
        from scenefw.api.predictor import Predictor

        return Predictor.built(Settings(["run=predict", *words]))
    if name == "labelling":
        from scenefw.api.labeller import Labeller

        return Labeller.built(Settings(["run=label", *words]))
    of_plugins = loaders()
    if name in of_plugins:
        return of_plugins[name].built(words)
    names = ["reconstruction", "labelling", *of_plugins]
    suggestion = near_misses(name, names)
    raise ConfigError(f"scenefw.load has no '{name}'; {suggestion}")


def loaders() -> dict[str, Any]:
    """What plugins add: `LOADERS` of a module `loading`, from names to classes with `built`."""
    modules = [
        importlib.import_module(f"{plugin.package}.loading")
        for plugin in plugins.activate()
        if (package_dir(plugin.package) / "loading.py").is_file()
    ]
    return {name: loader for module in modules for name, loader in module.LOADERS.items()}


def _override_value(value: Setting) -> str:
    """A value in the grammar of the command line."""
    if value is None or isinstance(value, bool):
        return {None: "null", True: "true", False: "false"}[value]
    if isinstance(value, list | tuple):
        return f"[{','.join(map(_override_value, value))}]"
    if isinstance(value, int | float):
        return repr(value)
    text = str(value)
    return text if _PLAIN.fullmatch(text) and text.lower() not in _NO_TEXT else quoted(text)
