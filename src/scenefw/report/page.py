"""The report of a run: one HTML page with its pictures beside it."""

from collections.abc import Mapping, Sequence
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from scenefw.core import final_split
from scenefw.core.files import write_text
from scenefw.core.final_split import Ledger
from scenefw.report.blocks import Scenes, Section
from scenefw.report.html import render
from scenefw.report.publication import publish
from scenefw.report.record import PAGE, command_line, read_record
from scenefw.report.threejs import three_js

_STYLE = Path(__file__).with_name("page.css")
_VIEWER = Path(__file__).with_name("scenes3d.js")


class Page:
    """Writes `report.html` into a run's folder, with the settings and versions found there.

    Args:
        title: heading of the page.
        publish: also write the sections as Markdown to this file, e.g. docs/results/osd.md;
            pictures of data that must not be published are left out. None = don't.
        ledger: of evaluations on the final split. One that is published is added to it, and every
            published file says how many there were by then. None = don't.
    """

    def __init__(
        self,
        title: str = "scenefw",
        publish: str | Path | None = None,
        ledger: str | Path | None = None,
    ) -> None:
        self.title = title
        self.publish = Path(publish) if publish else None
        self.ledger = Ledger(ledger) if ledger else None

    def write(self, folder: Path, sections: Sequence[Section], figures: Mapping[str, Any]) -> Path:
        """Writes the page and returns its path.

        Args:
            folder: the run's; `config.yaml` and `run.json` in it are shown.
            sections: in their order.
            figures: flat figures, as in `metrics.json`.

        Raises:
            StorageError: the folder can't be written, or the ledger is damaged.
        """
        record = read_record(folder)
        settings = folder / "config.yaml"
        text = render(
            "page.html.j2",
            title=self.title,
            style=_STYLE.read_text(encoding="utf-8"),
            facts=_facts(record),
            command=command_line(record) if record else "",
            sections=sections,
            libraries=_libraries() if _has_scenes(sections) else (),
            figures={name: _printed(value) for name, value in figures.items()},
            settings=settings.read_text(encoding="utf-8") if settings.is_file() else None,
            versions=record.get("versions"),
        )
        target = folder / PAGE
        write_text(target, text)
        if self.publish:
            if self.ledger and final_split.looks():
                self.ledger.add(self._entry(record))
            publish(self.publish, self.title, sections, folder, record, self.ledger)
        return target

    def _entry(self, record: Mapping[str, Any]) -> dict[str, Any]:
        """This evaluation on the final split."""
        return {
            "date": datetime.now(UTC).isoformat(timespec="seconds"),
            "commit": record.get("versions", {}).get("commit"),
            "command": command_line(record),
            "page": str(self.publish),
            "weights": record.get("weights", {}),
            "data": dict(final_split.looks()),
        }


def write_scene_page(path: Path, title: str, block: Scenes) -> None:
    """Writes one page that shows nothing but scenes, and needs no other file.

    Args:
        path: the file, replaced as a whole.
        title: of the page.
        block: the scenes.

    Raises:
        MissingDependencyError: three.js is not found.
        StorageError: the file can't be written.
    """
    style = _STYLE.read_text(encoding="utf-8")
    text = render("scene.html.j2", title=title, style=style, block=block, libraries=_libraries())
    write_text(path, text)


def _has_scenes(sections: Sequence[Section]) -> bool:
    return any(isinstance(block, Scenes) for section in sections for block in section.blocks)


def _libraries() -> tuple[str, str]:
    return three_js(), _VIEWER.read_text(encoding="utf-8")


def _facts(record: Mapping[str, Any]) -> list[str]:
    facts = [f"seed {record['seed']}"] if "seed" in record else []
    versions = record.get("versions", {})
    if "scenefw" in versions:
        facts.append(f"scenefw {versions['scenefw']}")
    if "commit" in versions:
        facts.append(f"commit {versions['commit'][:10]}")
    return facts


def _printed(value: Any) -> str:
    return f"{value:.6g}" if isinstance(value, int | float) else str(value)
