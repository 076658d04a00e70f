"""Arguments of classes and functions, read from their source without importing it."""

from __future__ import annotations

import ast
import re
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path

_ENTRY = re.compile(r"(\w+): ?(.*)")


@dataclass(frozen=True)
class Argument:
    """An argument: its default as written, None if it has none, and its line in `Args:`."""

    default: str | None
    about: str


def arguments(target: str, roots: Iterable[Path]) -> dict[str, Argument]:
    """Arguments by name of a dotted class or function; none if its source is not found.

    What a class doesn't say of an argument, the class that it extends may.

    Args:
        target: such as `scenefw.losses.tsdf.TsdfLoss`.
        roots: folders that packages lie in.
    """
    roots = list(roots)
    module, _, name = target.rpartition(".")
    files = (root.joinpath(*module.split(".")).with_suffix(".py") for root in roots)
    file = next((file for file in files if file.is_file()), None)
    if file is None:
        return {}
    body = ast.parse(file.read_text(encoding="utf-8")).body
    for node in body:
        if isinstance(node, ast.ClassDef | ast.FunctionDef) and node.name == name:
            about = described(ast.get_docstring(node) or "")
            defaults = dict(_defaults(node))
            base = {}
            if isinstance(node, ast.ClassDef):
                base = _inherited(node, body, module, roots)
                if not defaults:
                    return base
            names = {**dict.fromkeys(defaults), **dict.fromkeys(about)}
            of_base = {name: argument.about for name, argument in base.items()}
            return {n: Argument(defaults.get(n), about.get(n, of_base.get(n, ""))) for n in names}
    return {}


def _inherited(
    node: ast.ClassDef, body: list[ast.stmt], module: str, roots: list[Path]
) -> dict[str, Argument]:
    """Arguments of the first base that has some."""
    imported = {
        alias.asname or alias.name: f"{line.module}.{alias.name}"
        for line in body
        if isinstance(line, ast.ImportFrom)
        for alias in line.names
    }
    for base in node.bases:
        name = base.value if isinstance(base, ast.Subscript) else base
        if isinstance(name, ast.Name):
            base_arguments = arguments(imported.get(name.id, f"{module}.{name.id}"), roots)
            if base_arguments:
                return base_arguments
    return {}


def described(docstring: str) -> dict[str, str]:
    """What the section `Args:` of a docstring says about each argument."""
    descriptions: dict[str, list[str]] = {}
    lines = iter(docstring.splitlines())
    for line in lines:
        if line.strip() == "Args:":
            break
    indent = None
    for line in lines:
        depth = len(line) - len(line.lstrip())
        indent = depth if indent is None else indent
        entry = _ENTRY.fullmatch(line.strip())
        if not line.strip() or depth < indent:
            break
        if depth == indent and entry:
            descriptions[entry[1]] = [entry[2]]
        elif descriptions:
            next(reversed(descriptions.values())).append(line.strip())
    return {name: " ".join(words) for name, words in descriptions.items()}


def _defaults(node: ast.ClassDef | ast.FunctionDef) -> Iterator[tuple[str, str | None]]:
    if isinstance(node, ast.FunctionDef):
        yield from _signature(node.args)
        return
    makers = [n for n in node.body if isinstance(n, ast.FunctionDef) and n.name == "__init__"]
    if makers:
        yield from _signature(makers[0].args)
        return
    if not any("dataclass" in ast.unparse(line) for line in node.decorator_list):
        return
    for line in node.body:
        if isinstance(line, ast.AnnAssign) and isinstance(line.target, ast.Name):
            yield line.target.id, ast.unparse(line.value) if line.value else None


def _signature(args: ast.arguments) -> Iterator[tuple[str, str | None]]:
    plain = [*args.posonlyargs, *args.args]
    values: list[ast.expr | None] = [None] * (len(plain) - len(args.defaults))
    pairs: Mapping[ast.arg, ast.expr | None] = {
        **dict(zip(plain, [*values, *args.defaults], strict=True)),
        **dict(zip(args.kwonlyargs, args.kw_defaults, strict=True)),
    }
    for argument, value in pairs.items():
        if argument.arg != "self":
            yield argument.arg, ast.unparse(value) if value is not None else None
