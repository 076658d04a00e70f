"""The model card of a file of weights: what it is, how it was made, its figures."""

from collections.abc import Mapping, Sequence
from typing import Any

from scenefw.core.errors import InputError
from scenefw.learning.provenance import Provenance
from scenefw.report.blocks import Block, Code, Points, Section, Text
from scenefw.report.presentation import figure_table
from scenefw.report.tables import Column, Table
from scenefw_publishing.stored import StoredRun
from scenefw_publishing.summary import COLUMNS, parts_in
from scenefw_publishing.words import Words

_UNKNOWN = "not recorded"


_RENAMED = {"learning.fresh": "learning.reinitialise"}
"""Settings of stored commands that have another name by now."""


def card_sections(
    provenance: Provenance,
    words: Words | None = None,
    runs: Sequence[StoredRun] = (),
    before: Sequence[Mapping[str, Any]] = (),
    notes: Sequence[str] = (),
) -> tuple[Section, ...]:
    """The sections of a card.

    Args:
        provenance: what the file says of itself.
        words: texts for such a network; None = there are none, so the card has facts alone.
        runs: evaluations of these weights.
        before: metadata of earlier trainings that the file does not know of, the last one first.
        notes: limits that only those who trained it know.

    Raises:
        InputError: a run has no figures of such a network, or was of other weights.
    """
    trainings = (*provenance.trainings, *before)
    commands = tuple(str(t.get("command", f"# {_UNKNOWN}")) for t in reversed(trainings))
    limits = (*(words.limits if words else ()), *notes)
    return (
        Section("The network", (Text(_description(provenance, words)), _facts(provenance))),
        *([Section("Intended use", (Points(tuple(words.use)),))] if words else []),
        *([Section("Limits", (Points(limits),))] if limits else []),
        Section("Training", (_trainings(trainings), Code(commands))),
        Section("Figures", _figures(provenance, words, runs)),
        *([Section("Licence", (Text(words.licence),))] if words else []),
    )


def _description(provenance: Provenance, words: Words | None) -> str:
    if words:
        return words.what
    sees = provenance.metadata.get("input")
    keys = f"task: {provenance.task}" + (f" and input: {sees}" if sees else "")
    return f"A file conf/card/NAME.yaml with {keys} would say here what this network is for."


def _facts(provenance: Provenance) -> Points:
    grid, recipe = provenance.grid, provenance.recipe
    size = provenance.path.stat().st_size / 1e6
    facts = {
        "File": f"{provenance.path.name}, {size:.1f} MB, SHA-256 {provenance.digest}",
        "Network": recipe["_target_"].rpartition(".")[2],
        "Arguments": _listed({k: v for k, v in recipe.items() if k != "_target_"}),
        "Numbers in the file": f"{provenance.numbers / 1e6:.2f} million",
    }
    if provenance.omitted:
        facts["Left out, as only training needs it"] = ", ".join(provenance.omitted)
    if grid is not None:
        facts["Grid"] = f"{grid.resolution}³ voxels over {grid.extent:g} m"
    if "classes" in provenance.metadata:
        facts["Classes"] = ", ".join(provenance.metadata["classes"])
    facts["Written by"] = _listed(provenance.versions)
    return Points(tuple(f"{name}: {value}" for name, value in facts.items()))


def _trainings(trainings: Sequence[Mapping[str, Any]]) -> Table:
    """One column per training, in the order of time, and their sums."""
    ordered = list(reversed(trainings))
    names = [str(i + 1) for i in range(len(ordered))] if len(ordered) > 1 else ["training"]
    rows = [(name, tuple(cell(t) for t in ordered)) for name, cell in _ROWS.items()]
    if len(ordered) > 1:
        names.append("all")
        sums = {
            n: sum(float(t.get(n, 0)) for t in ordered) for n in ("steps", "samples", "seconds")
        }
        all_cells = {name: _ROWS[name](sums) for name in ("steps", "samples", "minutes")}
        rows = [(name, (*cells, all_cells.get(name, ""))) for name, cells in rows]
    note = "Minutes are of training alone, without validation and snapshots."
    commands = " ".join(str(training.get("command", "")) for training in trainings)
    for before, now in _RENAMED.items():
        if f"{before}=" in commands:
            note += f" {before} of a command is called {now} today."
    if len(ordered) > 1:
        note += " Each training starts from the weights of the one to its left."
    return Table("How it was trained", tuple(Column(n) for n in names), tuple(rows), note=note)


def _figures(
    provenance: Provenance, words: Words | None, runs: Sequence[StoredRun]
) -> tuple[Block, ...]:
    blocks: list[Block] = []
    for run in runs:
        tables = _summaries(run, words) if words and words.summaries else [figure_table(run)]
        blocks += [*tables, Code((run.origin, *_require_these_weights(provenance, run)))]
    return tuple(blocks) or (Text("None were given (run.results)."),)


def _summaries(run: StoredRun, words: Words) -> list[Table]:
    return [
        Table(part.title, COLUMNS, tuple(part.rows()), note=part.summary.note)
        for part in parts_in(run, words.summaries)
    ]


def _require_these_weights(provenance: Provenance, run: StoredRun) -> tuple[str, ...]:
    weights = run.record.get("weights")
    if not weights:
        return ("# that run did not record its weights",)
    if provenance.digest not in weights.values():
        raise InputError(
            f"{run.path} has figures of other weights ({', '.join(weights)}) than "
            f"{provenance.path}; evaluate these"
        )
    return ()


def _listed(values: Mapping[str, Any]) -> str:
    return ", ".join(f"{name} {value}" for name, value in values.items())


def _minutes(training: Mapping[str, Any]) -> str:
    return f"{training['seconds'] / 60:.0f}" if "seconds" in training else _UNKNOWN


def _epochs(training: Mapping[str, Any]) -> str:
    passed = training.get("images", training.get("scenes"))
    if "epochs" in training or not passed:
        return str(training.get("epochs", _UNKNOWN))
    return f"{training.get('samples', 0) / passed:.2f}"


def _data(training: Mapping[str, Any]) -> str:
    if "data" in training:
        return ", ".join(f"{count} scenes of {name}" for name, count in training["data"].items())
    if "images" in training:
        scenes = f" of {training['scenes']} tables" if "scenes" in training else ""
        return f"{training['images']} {training.get('input', 'images')}{scenes} an epoch"
    return f"{training['scenes']} scenes" if "scenes" in training else _UNKNOWN


def _noise(training: Mapping[str, Any]) -> str:
    if "noise" not in training:
        return _UNKNOWN
    noise = training["noise"]
    return str(noise) if isinstance(noise, str) else ", ".join(noise) or "none"


def _start(training: Mapping[str, Any]) -> str:
    before = training.get("started_from")
    if before:
        return _file(before)
    return "random weights" if "command" in training else _UNKNOWN


def _file(origin: Mapping[str, Any]) -> str:
    return f"{origin.get('file', '')} ({str(origin.get('sha256', ''))[:10]})"


def _mean(training: Mapping[str, Any]) -> str:
    """With which weights a training's were averaged afterwards."""
    partner = training.get("averaged_with")
    return f"{100 * partner['share']:.0f} % of {_file(partner)}" if partner else "none"


def _plain(name: str) -> Any:
    return lambda training: str(training.get(name, _UNKNOWN))


_ROWS = {
    "steps": lambda t: f"{t['steps']:.0f}" if "steps" in t else _UNKNOWN,
    "samples": lambda t: f"{t['samples']:.0f}" if "samples" in t else _UNKNOWN,
    "minutes": _minutes,
    "epochs": _epochs,
    "data": _data,
    "views of a scene": lambda t: ", ".join(map(str, t.get("views_of_a_scene", [1]))),
    "noise": _noise,
    "losses and weights": lambda t: _listed(t["losses"]) if "losses" in t else _UNKNOWN,
    "batch": _plain("batch_size"),
    # Trainings without a record are from when AdamW was the only optimiser.
    "optimiser": lambda t: str(t.get("optimizer", "AdamW")),
    "learning rate": _plain("learning_rate"),
    "started from": _start,
    "averaged with": _mean,
    "seed": _plain("seed"),
    "device, precision": lambda t: (
        ", ".join(filter(None, map(t.get, ("device", "precision")))) or _UNKNOWN
    ),
    "commit": lambda t: str(t.get("commit", _UNKNOWN))[:12],
}
