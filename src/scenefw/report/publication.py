"""Results as Markdown for the project's documents, with the commands that made them."""

import os
from collections.abc import Mapping, Sequence
from itertools import chain
from pathlib import Path
from typing import Any

from PIL import Image

from scenefw.core.files import write_text
from scenefw.core.final_split import Ledger
from scenefw.report.blocks import Block, Code, Drawing, Picture, Points, Scenes, Section, Text
from scenefw.report.pictures import save_for_document
from scenefw.report.record import command_line, used_weights
from scenefw.report.tables import Table, to_markdown

_GREY = "#808890"  # readable on white and black, as GitHub shows drawings on both


def publish(
    target: Path,
    title: str,
    sections: Sequence[Section],
    folder: Path,
    record: Mapping[str, Any],
    ledger: Ledger | None = None,
) -> Path:
    """Writes sections to a Markdown file, their drawings and shareable pictures to a folder beside.

    Args:
        target: e.g. docs/results/reconstruction.md; pictures go to docs/results/reconstruction/.
        title: heading.
        sections: as on the page; pictures that are not shareable are left out.
        folder: that of the page, which pictures are relative to.
        record: of the run: command line, seed, versions (`run.json`).
        ledger: of the final split; the file says how often that has been evaluated.

    Raises:
        StorageError: the file or the folder can't be written, or the ledger is damaged.
    """
    lines = [f"# {title}", "", *_origin(record)]
    if ledger:
        lines += [_final_split(ledger, target), ""]
    for i, section in enumerate(sections):
        body = [_block(b, target, folder, f"{i}-{j}") for j, b in enumerate(section.blocks)]
        if any(body):  # nothing is left of a section of pictures that are not shareable
            lines += [f"## {section.title}", "", *chain.from_iterable(body)]
    write_text(target, "\n".join(lines).rstrip() + "\n")
    return target


def _origin(record: Mapping[str, Any]) -> list[str]:
    versions = record.get("versions", {})
    facts = [f"seed {record['seed']}"] if "seed" in record else []
    if "commit" in versions:
        facts.append(f"commit {versions['commit'][:10]}")
    names = ("scenefw", "torch", "numpy", "python")
    facts += [f"{name} {versions[name]}" for name in names if name in versions]
    facts += used_weights(record)
    return ["```", command_line(record), "```", "", ", ".join(facts) + ".", ""]


def _final_split(ledger: Ledger, target: Path) -> str:
    """How often the final split has been evaluated, with a link to the list."""
    times = len(ledger.entries())
    if not times:
        return "The final split of the data had not been evaluated by then."
    where = Path(os.path.relpath(ledger.path, target.parent)).as_posix()
    how_often = "once" if times == 1 else f"{times} times"
    return f"The final split of the data had been evaluated {how_often} by then ([all]({where}))."


def _block(block: Block, target: Path, folder: Path, number: str) -> list[str]:
    beside = target.with_suffix("")
    match block:
        case Text(text):
            return [text, ""]
        case Points(points):
            return [*[f"- {point}" for point in points], ""]
        case Code(code):
            return ["```", *code, "```", ""]
        case Table():
            return [to_markdown(block), ""]
        case Drawing(svg, caption):
            drawing = beside / f"figure-{number}.svg"
            write_text(drawing, svg.replace("currentColor", _GREY))
            return [f"![{caption}]({beside.name}/{drawing.name})", "", caption, ""]
        case Scenes():
            return []  # Markdown can't show them
        case Picture(path, caption, _, shareable):
            if not shareable:
                return []
            picture = beside / f"{Path(path).stem}.webp"
            with Image.open(folder / path) as image:
                save_for_document(image, picture)
            return [f"![{caption}]({beside.name}/{picture.name})", "", caption, ""]
