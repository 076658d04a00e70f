"""Pages and blocks as HTML, from the templates beside this file."""

from collections.abc import Iterable, Iterator
from functools import cache
from itertools import groupby
from pathlib import Path
from typing import Any

from jinja2 import Environment, FileSystemLoader, StrictUndefined

from scenefw.report.blocks import Block, Picture
from scenefw.report.tables import printed

_TEMPLATES = Path(__file__).with_name("templates")


def render(name: str, **values: Any) -> str:
    """A template's text; everything not marked as safe is escaped."""
    return _environment().get_template(name).render(values)


@cache
def _environment() -> Environment:
    environment = Environment(
        loader=FileSystemLoader(_TEMPLATES),
        autoescape=True,
        trim_blocks=True,
        lstrip_blocks=True,
        keep_trailing_newline=True,
        undefined=StrictUndefined,
    )
    environment.filters.update(kind=_kind, printed=printed, rows=_rows)
    return environment


def _kind(block: Block) -> str:
    return type(block).__name__


def _rows(blocks: Iterable[Block]) -> Iterator[tuple[bool, Iterable[Block]]]:
    """Blocks in their order, pictures that follow each other together (True)."""
    return groupby(blocks, lambda block: isinstance(block, Picture))
