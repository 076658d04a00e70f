"""Puts the state of a training into files of 15 MB, and together again.

    python -m benchmarks.state_parts split outputs/training/last.ckpt FOLDER [--megabytes 60]
    python -m benchmarks.state_parts join FOLDER outputs/training/last.ckpt
    python -m benchmarks.state_parts fits 60 [experiment=simstack scale=thesis ...]

Without a limit every bit is kept: 16 bytes per weight (float32 weights, their average, two moments
of AdamW; Muon has one). With one, the first form is taken that fits, and the line printed says
which:

    exact    16 bytes per weight, 12 with Muon
    rounded   8, or 6: float16 weights and average, bfloat16 moments
    average   2: float16 average alone; the training goes on from it with new moments

`fits` says before a training whether the smallest form will be small enough.
"""

import argparse
import io
import sys
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import torch
from torch import Tensor

from scenefw import config, plugins
from scenefw.core.errors import CheckpointError, SceneFWError
from scenefw.core.files import replacing
from scenefw.learning.state import read_state, write_state

PART = 15_000_000  # bytes
_HALF = 65_000.0  # about the largest float16


def split(state: Path, folder: Path, megabytes: float | None = None) -> str:
    """Writes parts, removes older ones; returns the form's name.

    Raises:
        CheckpointError: no form is small enough.
    """
    whole = read_state(state)
    name, packed = _smallest_fit(whole, megabytes)
    for old in folder.glob("state.part*"):
        old.unlink()
    for number, start in enumerate(range(0, len(packed), PART)):
        with replacing(folder / f"state.part{number:03d}") as temporary:
            temporary.write_bytes(packed[start : start + PART])
    return name


def join(folder: Path, state: Path) -> str:
    """Writes the state that the parts of a folder hold; returns the form's name.

    Raises:
        CheckpointError: the folder holds none.
    """
    parts = sorted(folder.glob("state.part*"))
    if not parts:
        raise CheckpointError(f"no state.part* in {folder}; give the folder that `split` wrote to")
    packed = b"".join(part.read_bytes() for part in parts)
    try:
        whole = read_state(io.BytesIO(packed))
        name = whole.pop("form")
    except (CheckpointError, KeyError) as error:
        raise CheckpointError(
            f"the parts in {folder} are damaged, incomplete or not a state of a training; copy all "
            "of them again"
        ) from error
    write_state(state, whole if name == "exact" else _widened(whole))
    return name


def require_room(words: Sequence[str], megabytes: float) -> float:
    """Megabytes of the smallest form of the state of a training with these settings.

    Raises:
        CheckpointError: they are more than there is room for.
    """
    from hydra.utils import instantiate

    plugins.activate()
    model = instantiate(config.compose(words).model, _convert_="all")
    least = 2 * sum(weights.numel() for weights in model.parameters()) / 1e6
    if least > megabytes:
        raise CheckpointError(
            f"the network has {least / 2:.1f} million weights, the smallest form of its state "
            f"{least:.0f} MB, of which {megabytes:.0f} MB would be brought back; take a narrower "
            "network (size.network=narrow), or allow more"
        )
    return least


def _smallest_fit(whole: dict[str, Any], megabytes: float | None) -> tuple[str, bytes]:
    sizes = {}
    for name, form in FORMS.items():
        file = io.BytesIO()
        torch.save({**form(whole), "form": name}, file)
        sizes[name] = file.tell() / 1e6
        if megabytes is None or sizes[name] <= megabytes:
            return name, file.getvalue()
    found = ", ".join(f"{name} {size:.0f} MB" for name, size in sizes.items())
    raise CheckpointError(
        f"the state is larger than {megabytes:.0f} MB ({found}); take a narrower "
        "network, or allow more"
    )


def _rounded(whole: dict[str, Any]) -> dict[str, Any]:
    return {
        **_with_average(whole, _half),
        "state_dict": _converted(whole["state_dict"], _half),
        "optimizer_states": _converted(whole["optimizer_states"], lambda t: t.bfloat16()),
    }


def _averages(whole: dict[str, Any]) -> dict[str, Any]:
    """The average stands for the weights, too."""
    average = (whole["scenefw"]["average"] or {}).get("values", {})
    weights = {k: average.get(k.removeprefix("model."), v) for k, v in whole["state_dict"].items()}
    kept = {**whole["scenefw"], "average": None}
    optimisers = [{**optimiser, "state": {}} for optimiser in whole["optimizer_states"]]
    return {
        **whole,
        "scenefw": kept,
        "state_dict": _converted(weights, _half),
        "optimizer_states": optimisers,
    }


def _with_average(whole: dict[str, Any], convert: Callable[[Tensor], Tensor]) -> dict[str, Any]:
    return {
        **whole,
        "scenefw": {
            **whole["scenefw"],
            "average": _converted(whole["scenefw"]["average"], convert),
        },
    }


def _widened(whole: dict[str, Any]) -> dict[str, Any]:
    """The state in float32; an average that was left out begins with the weights."""
    wide = _converted(whole, lambda t: t.float())
    if wide["scenefw"]["average"] is None:
        values = {k.removeprefix("model."): v for k, v in wide["state_dict"].items()}
        values = {k: v.clone() for k, v in values.items() if v.is_floating_point()}
        wide["scenefw"]["average"] = {"updates": wide["global_step"], "values": values}
    return wide


def _half(value: Tensor) -> Tensor:
    return value.clamp(-_HALF, _HALF).half()


def _converted(tree: Any, convert: Callable[[Tensor], Tensor]) -> Any:
    """The same with its arrays of floats converted; single numbers stay exact."""
    if isinstance(tree, Tensor):
        return convert(tree) if tree.is_floating_point() and tree.numel() > 1 else tree
    if isinstance(tree, dict):
        return {key: _converted(value, convert) for key, value in tree.items()}
    if isinstance(tree, list):
        return [_converted(value, convert) for value in tree]
    return tree


FORMS: dict[str, Callable[[dict[str, Any]], dict[str, Any]]] = {
    "exact": lambda whole: whole,
    "rounded": _rounded,
    "average": _averages,
}


def main() -> None:
    """The command line."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    verbs = parser.add_subparsers(dest="verb", required=True)
    for verb in ("split", "join"):
        chosen = verbs.add_parser(verb)
        chosen.add_argument("source", type=Path)
        chosen.add_argument("target", type=Path)
    verbs.choices["split"].add_argument("--megabytes", type=float)
    fits = verbs.add_parser("fits")
    fits.add_argument("megabytes", type=float)
    fits.add_argument("words", nargs="*")
    options = parser.parse_args()
    try:
        if options.verb == "split":
            print(f"state: {split(options.source, options.target, options.megabytes)}")
        elif options.verb == "join":
            print(f"state: {join(options.source, options.target)}")
        else:
            least = require_room(options.words, options.megabytes)
            print(f"state: at least {least:.0f} MB")
    except SceneFWError as error:
        print(f"error: {error}", file=sys.stderr)
        sys.exit(2)


if __name__ == "__main__":
    main()
