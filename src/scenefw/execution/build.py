"""Builds the parts of a composed config, each node once, no matter how many others refer to it."""

from __future__ import annotations

import functools
import importlib.util
import inspect
import re
from collections.abc import Callable, Mapping
from typing import TYPE_CHECKING, Any

from scenefw import registry
from scenefw.config import near_misses
from scenefw.core.dotted_names import resolve
from scenefw.core.errors import ConfigError, SceneFWError, SettingError

if TYPE_CHECKING:
    from omegaconf import DictConfig, ListConfig

LATER = "_later_"
_TARGET, _PARTIAL = "_target_", "_partial_"
_OF_HYDRA = {_TARGET, _PARTIAL, "_convert_", "_recursive_"}


class Builder:
    """Turns nodes of a config into objects.

    A node with a `_target_` becomes what that class or function gives for the node's other keys as
    arguments; with `_partial_: true`, a function that still takes further arguments. A node
    `{_later_: a.b}` becomes a function without arguments that builds the node `a.b` when it is
    called: for parts that need what the same run makes first. Everything else becomes plain Python.
    Nodes that are referred to as `${a.b}` are built once and shared.

    Args:
        config: the whole, as composed.
    """

    def __init__(self, config: DictConfig) -> None:
        self.config = config
        self._built: dict[str, Any] = {}

    def build(self, key: str) -> Any:
        """The object of a node.

        Raises:
            ConfigError: the config has no such node, an argument is unknown or missing, a class
                can't be imported, or one fails with its own error.
            SceneFWError: as a component raises it.
        """
        from omegaconf import OmegaConf

        node: Any = OmegaConf.select(self.config, key)
        return self._node(node, key)

    def _node(self, node: Any, key: str) -> Any:
        from omegaconf import DictConfig, ListConfig

        if isinstance(node, ListConfig):
            return [self._child(node, i, f"{key}[{i}]") for i in range(len(node))]
        if not isinstance(node, DictConfig):
            return node
        if LATER in node:
            return functools.partial(self.build, str(node[LATER]))
        if _TARGET not in node:
            return {name: self._child(node, name, f"{key}.{name!s}") for name in node}
        full_key = node._get_full_key("") or key  # where it is defined, not where it is referenced
        if full_key not in self._built:
            self._built[full_key] = self._call(node, full_key)
        return self._built[full_key]

    def _child(self, node: DictConfig | ListConfig, name: Any, key: str) -> Any:
        from omegaconf import OmegaConf

        if OmegaConf.is_missing(node, name):
            raise ConfigError(f"{key} is not set; give {key}=...")
        return self._node(node[name], key)

    def _call(self, node: DictConfig, key: str) -> Any:
        component = _imported(str(node[_TARGET]), key)
        names = [name for name in node if name not in _OF_HYDRA]
        arguments = {str(name): self._child(node, name, f"{key}.{name!s}") for name in names}
        if node.get(_PARTIAL):
            return functools.partial(component, **arguments)
        _require_arguments(component, arguments, key)
        try:
            return component(**arguments)
        except SettingError as error:
            if error.name not in arguments:  # of a part that the class makes by itself
                raise
            where = _typed(node, error.name, key)
            raise SettingError(where, error.value, error.expected) from error
        except (SceneFWError, OSError):
            raise
        except Exception as error:
            raise ConfigError(
                f"{key} cannot be built: {_name(component)} says {type(error).__name__}: {error}"
            ) from error


def _typed(node: DictConfig, name: str, key: str) -> str:
    """The key to type for an argument: that which it takes its value from, or else its own."""
    from omegaconf import OmegaConf

    raw: Any = OmegaConf.to_container(node, resolve=False)
    reference = re.fullmatch(r"\$\{([a-z]\w*(?:\.\w+)*)\}", str(raw[name]))
    return reference[1] if reference else f"{key}.{name}"


def _imported(target: str, key: str) -> Callable[..., Any]:
    try:
        component: Callable[..., Any] = resolve(target)
    except SceneFWError:
        raise
    except (Exception, SystemExit) as error:  # whatever the code of a plugin raises
        reason = f"{type(error).__name__}: {error}"
        hint = _missing(error) or _moved(target)
        raise ConfigError(f"{key}: cannot import {target} ({reason}){hint}") from error
    return component


def _moved(target: str) -> str:
    """Where a class of scenefw that options name has gone, if it isn't where it was."""
    package, _, name = target.rpartition(".")
    if not package.startswith("scenefw"):
        return ""
    texts = (path.read_text("utf-8") for path in registry.files())
    pattern = re.compile(rf"_target_: (scenefw[\w.]*\.{re.escape(name)})\s")
    targets = sorted({match for text in texts for match in pattern.findall(text)} - {target})
    return f"; {name} is now {' or '.join(targets)}" if targets else ""


def _missing(error: BaseException) -> str:
    """What to do about an import that failed, if a whole library is missing."""
    name = (error.name or "") if isinstance(error, ModuleNotFoundError) else ""
    library = name.partition(".")[0]
    if not library or _is_there(library):
        return ""
    if _is_there(spelling := library.replace("-", "_")):
        return f"; did you mean {spelling}?"
    return f"; install the package that has {library}"


def _is_there(module: str) -> bool:
    try:
        return importlib.util.find_spec(module) is not None
    except ValueError:  # imported without a specification
        return True


def _require_arguments(
    component: Callable[..., Any], arguments: Mapping[str, Any], key: str
) -> None:
    """Says which argument is unknown or missing, where that can be known before the call."""
    try:
        parameters = inspect.signature(component).parameters
    except (TypeError, ValueError):  # written in C
        return
    if not any(p.kind is p.VAR_KEYWORD for p in parameters.values()):
        for name in arguments:
            if name not in parameters:
                raise ConfigError(
                    f"{key}.{name}: {_name(component)} has no argument {name}; "
                    f"{near_misses(name, list(parameters))}"
                )
    for name, p in parameters.items():
        required = p.default is p.empty and p.kind not in (p.VAR_KEYWORD, p.VAR_POSITIONAL)
        if required and name not in arguments:
            raise ConfigError(f"{key}.{name} is not set, and {_name(component)} needs it")


def _name(component: Callable[..., Any]) -> str:
    return getattr(component, "__name__", str(component))
