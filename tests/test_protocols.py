"""Every option of every group keeps its group's protocol, and nobody asks for more than it says."""

import ast
import inspect
import pkgutil
from pathlib import Path

from tests.composed import option

from scenefw import plugins, registry
from scenefw.contracts import problems, protocol_named

ROOT = Path(__file__).parents[1]
SOURCES = [
    path
    for folder in (ROOT / "src", *sorted((ROOT / "plugins").glob("*/src")))
    for path in sorted(folder.rglob("*.py"))
]
# What is looked at there is no component: arrays, C extensions, annotations, data of a library.
PROBED = {
    "argument_types.py", "contracts.py", "compile.py", "receptive_field.py", "shapenet.py",
    "build.py",
}  # fmt: skip


def options():
    plugins.activate()
    for group, names in registry.catalogue().items():
        if registry.group(group).protocols:
            yield from ((group, name) for name in names)


def targets(node):
    """Classes of an option: its own, or, where it is a dict of several, that of each."""
    node = node.get("run", node)  # a verb that also sets what lies outside of `run`
    if "_target_" in node:
        return [node["_target_"]]
    return [
        each["_target_"] for each in node.values() if hasattr(each, "get") and "_target_" in each
    ]


def test_every_option_keeps_a_protocol_of_its_group():
    for group, name in options():
        promised = [protocol_named(each) for each in registry.group(group).protocols]
        for target in targets(option(group, name)):
            made = pkgutil.resolve_name(target)
            assert inspect.isclass(made), f"{target} is no class"
            found = {each.__name__: list(problems(made, each)) for each in promised}
            assert not all(found.values()), f"{target}: {found}"


def test_nobody_feels_for_what_a_protocol_does_not_say():
    probing = [f"{path}:{line}" for path in SOURCES if path.name not in PROBED
               for line in probes(path)]  # fmt: skip
    assert not probing, "feel for an attribute; put it into the protocol"


def probes(path):
    """Lines of a file that ask whether an object has an attribute."""
    text = path.read_text(encoding="utf-8")
    if "getattr(" not in text and "hasattr(" not in text:
        return
    tree = ast.parse(text)
    imported = [node for node in ast.walk(tree) if isinstance(node, ast.Import)]
    modules = {entry.name.partition(".")[0] for node in imported for entry in node.names}
    for node in ast.walk(tree):
        if not isinstance(node, ast.Call) or not isinstance(node.func, ast.Name) or not node.args:
            continue
        if ast.unparse(node.args[0]).partition(".")[0] in modules:
            continue  # what a platform or a version of a library has
        if node.func.id == "hasattr" or (
            node.func.id == "getattr"
            and len(node.args) == 3
            and isinstance(node.args[1], ast.Constant)
        ):
            yield node.lineno
