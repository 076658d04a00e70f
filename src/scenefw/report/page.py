"""The report of a run: one HTML page with its pictures beside it."""

import html
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from scenefw.core.files import write_text
from scenefw.report.blocks import Block, Code, Drawing, Picture, Points, Section, Text
from scenefw.report.publication import publish
from scenefw.report.record import command_line, read_record
from scenefw.report.tables import Table, to_html

_STYLE = Path(__file__).with_name("page.css")


class Page:
    """Writes `report.html` into a run's folder, with the settings and versions found there.

    Args:
        title: heading of the page.
        publish: also write the sections as Markdown to this file, e.g. docs/results/osd.md;
            pictures of data that must not be published are left out. None = don't.
    """

    def __init__(self, title: str = "scenefw", publish: str | Path | None = None) -> None:
        self.title = title
        self.publish = Path(publish) if publish else None

    def write(self, folder: Path, sections: Sequence[Section], figures: Mapping[str, Any]) -> Path:
        """Writes the page and returns its path.

        Args:
            folder: the run's; `config.yaml` and `run.json` in it are shown.
            sections: in their order.
            figures: flat figures, as in `metrics.json`.

        Raises:
            StorageError: the folder can't be written.
        """
        record = read_record(folder)
        body = [_header(self.title, record)]
        body += [_section(section) for section in sections]
        body += [_figures(figures), _settings(folder / "config.yaml"), _versions(record)]
        target = folder / "report.html"
        write_text(target, _document(self.title, "\n".join(filter(None, body))))
        if self.publish:
            publish(self.publish, self.title, sections, folder, record)
        return target


def _document(title: str, body: str) -> str:
    style = _STYLE.read_text(encoding="utf-8")
    return (
        "<!doctype html>\n<html lang=en><head><meta charset=utf-8>"
        '<meta name=viewport content="width=device-width, initial-scale=1">'
        '<meta name=color-scheme content="light dark">'
        f"<title>{html.escape(title)}</title><style>{style}</style></head>\n"
        f"<body><main>{body}</main></body></html>\n"
    )


def _header(title: str, record: Mapping[str, Any]) -> str:
    facts = []
    if "seed" in record:
        facts.append(f"seed {record['seed']}")
    versions = record.get("versions", {})
    if "scenefw" in versions:
        facts.append(f"scenefw {versions['scenefw']}")
    if "commit" in versions:
        facts.append(f"commit {versions['commit'][:10]}")
    line = " · ".join(html.escape(fact) for fact in facts)
    command = f"<pre class=command>{html.escape(command_line(record))}</pre>" if record else ""
    return f"<header><h1>{html.escape(title)}</h1><p class=note>{line}</p>{command}</header>"


def _section(section: Section) -> str:
    parts, row = [], []
    for block in section.blocks:
        if isinstance(block, Picture):
            row.append(_block(block))
            continue
        parts += _gallery(row)
        row = []
        parts.append(_block(block))
    parts += _gallery(row)
    return f"<section><h2>{html.escape(section.title)}</h2>{''.join(parts)}</section>"


def _gallery(pictures: Sequence[str]) -> list[str]:
    return [f"<div class=gallery>{''.join(pictures)}</div>"] if pictures else []


def _block(block: Block) -> str:
    match block:
        case Text(text):
            return f"<p>{html.escape(text)}</p>"
        case Points(points):
            return f"<ul>{''.join(f'<li>{html.escape(point)}</li>' for point in points)}</ul>"
        case Code(lines):
            return f"<pre class=command>{html.escape(chr(10).join(lines))}</pre>"
        case Drawing(svg, caption):
            note = f"<p class=note>{html.escape(caption)}</p>" if caption else ""
            return f"<figure class=drawing>{svg}{note}</figure>"
        case Picture(path, caption, links):
            files = " · ".join(
                f'<a href="{html.escape(target)}">{html.escape(text)}</a>' for text, target in links
            )
            words = "<br>".join(filter(None, [html.escape(caption), files]))
            source = html.escape(path)
            return (
                f'<figure><a href="{source}"><img src="{source}" alt="{html.escape(caption)}" '
                f"loading=lazy></a><figcaption>{words}</figcaption></figure>"
            )
        case Table():
            return to_html(block)


def _figures(figures: Mapping[str, Any]) -> str:
    rows = "".join(
        f"<tr><th scope=row>{html.escape(name)}</th><td>{_number(value)}</td></tr>"
        for name, value in figures.items()
    )
    return _folded("All figures (metrics.json)", f"<table class=plain>{rows}</table>")


def _number(value: Any) -> str:
    return f"{value:.6g}" if isinstance(value, int | float) else html.escape(str(value))


def _settings(path: Path) -> str:
    if not path.is_file():
        return ""
    text = html.escape(path.read_text(encoding="utf-8"))
    return _folded("Settings (config.yaml)", f"<pre>{text}</pre>")


def _versions(record: Mapping[str, Any]) -> str:
    if not record.get("versions"):
        return ""
    rows = "".join(
        f"<tr><th scope=row>{html.escape(name)}</th><td>{html.escape(str(version))}</td></tr>"
        for name, version in record["versions"].items()
    )
    return _folded("Versions (run.json)", f"<table class=plain>{rows}</table>")


def _folded(title: str, body: str) -> str:
    return (
        f"<details><summary>{html.escape(title)}</summary><div class=scroll>{body}</div></details>"
    )
