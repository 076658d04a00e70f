"""The command line: `python -m scenefw experiment=simstack`, with Hydra's overrides and sweeps."""

from __future__ import annotations

import errno
import gc
import os
import sys
import traceback
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from scenefw import config, plugins, registry
from scenefw.command_words import with_flags_first, with_homes
from scenefw.core.errors import ConfigError, IncompleteError, SceneFWError
from scenefw.core.signals import Terminated, raise_on_sigterm
from scenefw.core.streams import end_if_unread, ending_quietly
from scenefw.core.versions import installed
from scenefw.explanations import explain

if TYPE_CHECKING:
    from omegaconf import DictConfig

_WITH_VALUE = {"--cfg", "-c", "--package", "-p", "--config-path", "-cp", "--config-name", "-cn"}
_NO_ROOM = {errno.ENOSPC, errno.EDQUOT, errno.EFBIG, errno.EROFS, errno.EIO}
_COMPLETION = {"-sc", "--shell-completion"}
_incomplete: list[IncompleteError] = []
_TRACEBACK = "SCENEFW_TRACEBACK"  # set to 1 by -v; runs of a sweep in other processes see it too

USAGE = """\
scenefw: complete, instance-segmented 3D scenes from depth views of cluttered table-tops

usage: python -m scenefw [-m] [-v] [group=option ...] [key=value ...]

  python -m scenefw experiment=simstack                         stacks, training, evaluation, report
  python -m scenefw experiment=simstack run=predict input=PATH  a depth image to a 3D scene
  python -m scenefw run=doctor input=PATH                       checks an image of your own camera
  python -m scenefw experiment=simstack run=train size.minutes=60
  python -m scenefw experiment=simstack run=evaluate            figures of the shipped weights
  python -m scenefw experiment=simstack run=generate            regenerates the stacks
  python -m scenefw experiment=osd input=FOLDER                 scores on labelled real images
  python -m scenefw run=label input=FOLDER                      an RGB-D sequence to a labelled map
  python -m scenefw experiment=labelling                        labelling strategies compared
  python -m scenefw -m experiment=simstack debug=smoke seed=1,2 a sweep: one run per value
  python -m scenefw run=predict --cfg job --package run         the settings of run=predict

  --list         every group and option with a line on each, plugins included
  --list GROUP   the options of a group (or several), with their arguments and values
  --cfg job      prints the composed settings and stops
  -m             sweeps over comma-separated values
  -v             shows the whole traceback of an error
  -sc install=bash   completes all this in bash (zsh), as eval "$(scenefw -sc install=bash)"
  --hydra-help   what Hydra adds to all this
  --version      prints the version

groups (group=option):"""


def main(arguments: Sequence[str] | None = None) -> None:
    """Runs the command line; ends the process with 2 after an error that the user can fix."""
    words = list(sys.argv[1:] if arguments is None else arguments)
    if "-v" in words or os.environ.get("HYDRA_FULL_ERROR") == "1":
        os.environ[_TRACEBACK] = "1"
    os.environ["HYDRA_FULL_ERROR"] = "1"  # Hydra hands errors on instead of printing and exiting
    sys.argv[1:] = [word for word in words if word != "-v"]
    raise_on_sigterm()
    gc.disable()  # till the work begins: imports and settings leave none, and take a fifth longer
    try:
        with ending_quietly():
            _guarded(sys.argv[1:])
    finally:
        gc.enable()


def _guarded(words: list[str]) -> None:
    try:
        _dispatch(words)
        if sys.stdout is not None:
            sys.stdout.flush()  # here, where an error is one line
    except KeyboardInterrupt as stop:
        terminated = isinstance(stop, Terminated)
        words = [
            word for word in ("terminated" if terminated else "interrupted", str(stop)) if word
        ]
        print(": ".join(words), file=sys.stderr)
        sys.exit(143 if terminated else 130)
    except Exception as error:
        _stop(error, composing=True)
        raise


def _dispatch(words: list[str]) -> None:
    if not words or {"-h", "--help"} & set(words):
        _print_help()
    elif "--version" in words:
        print(f"scenefw {installed(['scenefw']).get('scenefw', 'of an unknown version')}")
    elif "--list" in words:
        _print_list(words)
    elif words[0] in _COMPLETION:
        _complete(words[1:])
    else:
        _run()


def _print_help() -> None:
    plugins.refuse_clashes(plugins.find())
    print(USAGE)
    core = config.conf_dir()
    for group, options in registry.catalogue().items():
        if group != "run":
            print(f"  {group:<16} {', '.join(sorted(options))}")
    verbs = registry.options("run")
    of_core = {verb: path for verb, path in verbs.items() if path.is_relative_to(core)}
    print("\nverbs (run=verb):")
    _print_verbs(of_core)
    print("\nverbs of plugins:")
    _print_verbs({verb: path for verb, path in verbs.items() if verb not in of_core})
    print("\n  --list says what the options are")


def _print_verbs(verbs: Mapping[str, Path]) -> None:
    for verb, path in sorted(verbs.items()):
        print(f"  {verb:<16} {registry.description(path)}")


def _print_list(words: list[str]) -> None:
    """The catalogue, or the groups named after --list."""
    from scenefw import listing

    plugins.refuse_clashes(plugins.find())
    after = words[words.index("--list") + 1 :]
    if after:
        for name in after:
            registry.options(name)  # a slip is an error before anything is printed
        for name in after:
            listing.print_group(name)
    else:
        listing.print_catalogue()


def _complete(words: list[str]) -> None:
    """What a shell asks for its completion; shells that we don't know are left to Hydra."""
    from scenefw import completion

    verb, _, shell = "".join(words[:1]).partition("=")
    if shell not in completion.SHELLS:
        _run()
    elif verb == "query":
        line = os.environ.get("COMP_LINE", "")
        point = os.environ.get("COMP_POINT", "")
        for answer in completion.answers(line[: int(point)] if point.isdigit() else line):
            print(answer)
    else:
        print(completion.UNINSTALL if verb == "uninstall" else completion.script())


def _run() -> None:
    import hydra

    from scenefw.execution.made_folders import empty_ones_removed

    sys.argv[1:] = with_homes(with_flags_first(sys.argv[1:]))
    plugins.activate()
    config.compose_once(sys.argv[1:], registry.folders())
    start = hydra.main(
        version_base="1.3", config_path=str(config.conf_dir()), config_name=config.ROOT_CONFIG
    )
    with empty_ones_removed():
        start(_task)()
    if _incomplete:
        sys.exit(2)


def _task(settings: DictConfig) -> Mapping[str, Any]:
    """One run; errors end the process here, before Hydra adds its own lines."""
    from scenefw.execution.run import execute

    try:
        return execute(settings)
    except IncompleteError as error:  # further runs of a sweep may be whole
        print(f"error: {error}", file=sys.stderr)
        _incomplete.append(error)
        return error.figures
    except Exception as error:  # noqa: BLE001 - the end of the line for every error
        _stop(error)
        traceback.print_exception(error)
        sys.exit(1)


def _stop(error: Exception, *, composing: bool = False) -> None:
    """Ends the process with one line, after the traceback if -v is given.

    It does not if scenefw itself is at fault.
    """
    end_if_unread(error)
    line = _complaint(error, composing)
    if line is not None:
        if _verbose():
            traceback.print_exception(error)
        print(f"error: {line}{_place_in_sweep()}", file=sys.stderr)
        sys.exit(2)


def _verbose() -> bool:
    return os.environ.get(_TRACEBACK) == "1"


def _place_in_sweep() -> str:
    """Which run of a sweep it was that failed, and how many are left."""
    from hydra.core.hydra_config import HydraConfig
    from hydra.types import RunMode

    if not HydraConfig.initialized() or HydraConfig.get().mode != RunMode.MULTIRUN:
        return ""
    settings, count = HydraConfig.get(), config.runs_of_sweep(sys.argv[1:])
    number = int(settings.job.num) + 1
    place = f"run {number} of {count} of the sweep, {settings.job.override_dirname}"
    one_by_one = str(settings.launcher.get("_target_")).endswith("BasicLauncher")
    note = f"; not started: {count - number}" if one_by_one else ""
    return f" ({place}{note})"


def _complaint(error: Exception, composing: bool) -> str | None:
    """The one line for the user, or None for an error that is a fault of scenefw itself."""
    cause: BaseException | None = error
    while cause is not None:
        if isinstance(cause, SceneFWError):
            return " ".join(str(cause).split())
        cause = cause.__cause__
    if isinstance(error, OSError) and error.filename is not None:
        return _unusable_path(error)
    if isinstance(error, OSError) and error.errno in _NO_ROOM:
        return f"cannot write: {error.strerror}; free some space, or give paths.output=FOLDER"
    if composing or type(error).__module__.startswith(("hydra.", "omegaconf.")):
        return f"{_misconfigured(error)}{'' if _verbose() else ' (-v shows the traceback)'}"
    return None


def _unusable_path(error: OSError) -> str:
    path = Path(os.fsdecode(error.filename))
    file = next((place for place in (path, *path.parents) if place.is_file()), None)
    if isinstance(error, FileExistsError | NotADirectoryError) and file is not None:
        return f"cannot use {path}: {file} is a file, not a folder; give another path"
    return f"cannot use {path}: {error.strerror}; give another path, or make it writable"


def _misconfigured(error: Exception) -> ConfigError:
    words = sys.argv[1:]
    pairs = zip(["", *words], words, strict=False)
    overrides = [w for before, w in pairs if not w.startswith("-") and before not in _WITH_VALUE]
    options = {group: sorted(names) for group, names in registry.catalogue().items()}
    return explain(error, overrides, options)


if __name__ == "__main__":
    main()
