"""Trainings in files of 15 MB, to take to another machine and back.

    python -m benchmarks.travel pack FOLDER --megabytes 15 thesis_simstack [NAME ...]
    python -m benchmarks.travel unpack FOLDER

A state has three forms. The largest states take the next smaller form until all fit:

    exact     16 bytes per weight: float32 weights, their average, two moments of AdamW
    rounded    8: float16 weights and average, bfloat16 moments
    factored   2: float16 weights; of the second moments their means over rows and columns, whose
               outer product stands for them (Shazeer and Stern 2018); first moments and the average
               start over, which takes some ten and some hundred steps
"""

import argparse
import io
import sys
from collections.abc import Callable, Iterable, Mapping
from pathlib import Path
from typing import Any

import torch
from torch import Tensor

from benchmarks.trainings import STATE, states_folder
from scenefw.core.errors import CheckpointError, SceneFWError
from scenefw.core.files import replacing
from scenefw.learning.runtime.state import read_state, write_state

PART = 15_000_000  # bytes
_HALF = 65_000.0  # about the largest float16
_SECOND, _FIRST = "exp_avg_sq", ("exp_avg", "momentum_buffer")
_MEANS = ("rows", "columns")

Form = Callable[[dict[str, Any]], dict[str, Any]]


def pack(
    states: Mapping[str, Path], folder: Path, megabytes: float, extra: Mapping[str, Any] = {}
) -> dict[str, str]:
    """Writes states into parts, and removes older ones; returns the form of each.

    Args:
        states: files by the name of their training.
        folder: where `trainings.part000` and so on go.
        megabytes: that all may take.
        extra: what else travels, plain data and tensors.

    Raises:
        CheckpointError: no form is small enough, or a state is damaged.
    """
    whole = {name: read_state(path) for name, path in states.items()}
    forms = dict.fromkeys(whole, "exact")
    packed = {name: _bytes(state) for name, state in whole.items()}
    while True:
        load = _bytes({"states": packed, "forms": forms, "extra": dict(extra)})
        if len(load) <= 1e6 * megabytes:
            break
        wider = [name for name, form in forms.items() if form != "factored"]
        if not wider:
            raise CheckpointError(
                f"the states of {', '.join(whole)} take {len(load) / 1e6:.1f} MB in their smallest "
                f"form, of {megabytes:g} MB allowed: take fewer trainings, or allow more"
            )
        name = max(wider, key=lambda each: len(packed[each]))
        forms[name] = "rounded" if forms[name] == "exact" else "factored"
        packed[name] = _bytes(FORMS[forms[name]](whole[name]))
    for old in folder.glob("trainings.part*"):
        old.unlink()
    for number, start in enumerate(range(0, len(load), PART)):
        with replacing(folder / f"trainings.part{number:03d}") as temporary:
            temporary.write_bytes(load[start : start + PART])
    return forms


def unpack(folder: Path, target: Path) -> tuple[dict[str, str], dict[str, Any]]:
    """Writes the states that parts hold into `target/NAME/last.ckpt`; forms, and what else came.

    Raises:
        CheckpointError: parts are missing or damaged.
    """
    parts = sorted(folder.glob("trainings.part*"))
    if not parts:
        raise CheckpointError(f"no trainings.part* in {folder}; give the folder of `pack`")
    load = _read(b"".join(part.read_bytes() for part in parts), folder)
    if {"states", "forms", "extra"} - load.keys():
        raise CheckpointError(f"the parts in {folder} hold no trainings; copy all of them again")
    for name, packed in load["states"].items():
        state = _read(_unwrapped(packed), folder)
        form = load["forms"][name]
        write_state(target / name / STATE, state if form == "exact" else _widened(state))
    return load["forms"], _unwrapped(load["extra"])


def _read(packed: bytes, folder: Path) -> dict[str, Any]:
    try:
        return read_state(io.BytesIO(packed))
    except CheckpointError as error:
        raise CheckpointError(
            f"the parts in {folder} are damaged or incomplete; copy all of them again"
        ) from error


def _bytes(state: dict[str, Any]) -> bytes:
    file = io.BytesIO()
    torch.save(_wrapped(state), file)
    return file.getvalue()


def _wrapped(tree: Any) -> Any:
    """The same with its bytes as arrays: in a pickle they would take half as much again."""
    if isinstance(tree, bytes):
        return torch.frombuffer(bytearray(tree), dtype=torch.uint8)
    return {n: _wrapped(v) for n, v in tree.items()} if isinstance(tree, dict) else tree


def _unwrapped(tree: Any) -> Any:
    """The bytes that `_wrapped` made arrays of."""
    if isinstance(tree, Tensor) and tree.dtype == torch.uint8:
        return tree.numpy().tobytes()
    return {n: _unwrapped(v) for n, v in tree.items()} if isinstance(tree, dict) else tree


def _rounded(whole: dict[str, Any]) -> dict[str, Any]:
    progress = whole["scenefw"]
    return {
        **whole,
        "scenefw": {**progress, "average": _converted(progress["average"], _half)},
        "state_dict": _converted(whole["state_dict"], _half),
        "optimizer_states": _converted(whole["optimizer_states"], lambda t: t.bfloat16()),
    }


def _factored(whole: dict[str, Any]) -> dict[str, Any]:
    return {
        **whole,
        "scenefw": {**whole["scenefw"], "average": None},
        "state_dict": _converted(whole["state_dict"], _half),
        "optimizer_states": [
            {
                **optimizer,
                "state": {key: _few(moments) for key, moments in optimizer["state"].items()},
            }
            for optimizer in whole["optimizer_states"]
        ],
    }


def _few(moments: Mapping[str, Any]) -> dict[str, Any]:
    """Moments of one weight: none of the first, means of the second where it has columns."""
    few = {name: value for name, value in moments.items() if name not in (_SECOND, *_FIRST)}
    for name in set(_FIRST) & moments.keys():
        few[name] = list(moments[name].shape)
    if _SECOND in moments:
        second = moments[_SECOND]
        table = second.reshape(len(second), -1) if second.ndim > 1 else second
        narrow = second.ndim < 2
        few[_SECOND] = table if narrow else {n: table.mean(1 - i) for i, n in enumerate(_MEANS)}
    return few


def _many(moments: Mapping[str, Any]) -> dict[str, Any]:
    """The moments that `_few` left something of."""
    shapes = {name: value for name, value in moments.items() if name in _FIRST}
    many = dict(moments)
    for name, shape in shapes.items():
        if isinstance(shape, list):
            many[name] = torch.zeros(shape)
    means = moments.get(_SECOND)
    if isinstance(means, dict):
        rows, columns = (means[name].float() for name in _MEANS)
        outer = torch.outer(rows, columns) / rows.mean().clamp_min(1e-30)
        many[_SECOND] = outer.reshape(shapes[_FIRST[0]])
    return many


def _widened(whole: dict[str, Any]) -> dict[str, Any]:
    """The state in float32; an average that was left out begins with the weights."""
    wide = _converted(whole, lambda t: t.float())
    for optimizer in wide["optimizer_states"]:
        optimizer["state"] = {key: _many(m) for key, m in optimizer["state"].items()}
    if wide["scenefw"]["average"] is None:
        values = {k.removeprefix("model."): v for k, v in wide["state_dict"].items()}
        values = {k: v.clone() for k, v in values.items() if v.is_floating_point()}
        wide["scenefw"]["average"] = {"updates": 0, "values": values}
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


FORMS: dict[str, Form] = {"rounded": _rounded, "factored": _factored}


def main() -> None:
    """The command line."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    verbs = parser.add_subparsers(dest="verb", required=True)
    packing = verbs.add_parser("pack")
    packing.add_argument("folder", type=Path)
    packing.add_argument("names", nargs="+")
    packing.add_argument("--megabytes", type=float, default=15.0)
    verbs.add_parser("unpack").add_argument("folder", type=Path)
    options = parser.parse_args()
    try:
        if options.verb == "pack":
            states = {name: states_folder() / name / STATE for name in options.names}
            _say(pack(states, options.folder, options.megabytes).items())
        else:
            _say(unpack(options.folder, states_folder())[0].items())
    except SceneFWError as error:
        print(f"error: {error}", file=sys.stderr)
        sys.exit(2)


def _say(forms: Iterable[tuple[str, str]]) -> None:
    for name, form in forms:
        print(f"{name}: {form}")


if __name__ == "__main__":
    main()
