"""What `_group.yaml` says of every group: it is there, and it is true."""

import functools
import re

import pytest
from omegaconf import OmegaConf

from scenefw import config, listing, plugins, registry
from scenefw.config import package_dir
from scenefw.contracts import protocol_named
from scenefw.execution.build import LATER

GROUPS = sorted(registry.catalogue())
VERBS = registry.names("run")
EXAMPLES = {"object_count", "point_cloud"}  # the other plugins are bundled: always found
OF_PLUGINS = {pair for plugin in plugins.find() for pair in plugin.options()}
OF_EXAMPLES = {
    pair for plugin in plugins.find() if plugin.name in EXAMPLES for pair in plugin.options()
}
REFERENCE = re.compile(r"\$\{(?:oc\.[\w.]+:)?(\w[\w.]*)(?![\w.:])")


@pytest.fixture(scope="module", autouse=True)
def _plugins():
    plugins.activate()


def test_every_group_says_what_it_is():
    roots = (package_dir("scenefw"), *(plugin.source for plugin in plugins.find()))
    for group in map(registry.group, GROUPS):
        assert 10 <= len(group.about) <= 90, f"conf/{group.name}/_group.yaml: about: one line"
        if group.package:
            assert any((root / group.package).is_dir() for root in filter(None, roots)), group
        for protocol in group.protocols:
            assert protocol_named(protocol)


WITHOUT_PROTOCOL = {
    "card": "data alone: words and names of figures",
    "learning": "subclasses of TrainingModule",
    "noise_per_scene": "noises of group noise, by scene",
    "trainer": "numbers for Lightning's trainer",
}


def test_groups_of_components_say_what_these_promise():
    groups = [registry.group(name) for name in GROUPS]
    silent = {group.name for group in groups if group.package and not group.protocols}
    assert silent == set(WITHOUT_PROTOCOL)


def test_a_group_says_which_verbs_read_it():
    for name in GROUPS:
        said = set(registry.group(name).verbs)
        of_plugin = all((name, option) in OF_PLUGINS for option in registry.names(name))
        verbs = [verb for verb in VERBS if of_plugin or ("run", verb) not in OF_PLUGINS]
        read = {verb for verb in verbs if name in read_by(verb, of_plugin)}
        expected = set() if said == {"any"} else said
        assert read == expected, f"conf/{name}/_group.yaml: verbs: [{', '.join(sorted(read))}]"


def test_verbs_follow_references_through_options():
    """Of the verbs that this test itself relies on."""
    assert {"learning", "model", "loss", "dataset", "renderer"} <= read_by("train")
    assert {"labelling", "label_source", "key_frames"} <= read_by("label")
    assert "model" not in read_by("evaluate")
    assert {"label_source", "presentation"} <= read_by("pipeline")  # of any evaluation


def test_metadata_with_a_key_that_is_none_is_refused(tmp_path, monkeypatch):
    (tmp_path / "thing").mkdir()
    (tmp_path / "thing" / "_group.yaml").write_text("abuot: things\n")
    monkeypatch.setattr(registry, "folders", lambda: [tmp_path])
    with pytest.raises(config.ConfigError, match="abuot"):
        registry.group("thing")


@functools.cache
def read_by(verb, plugins_too=False):
    """Groups that a verb can reach by references, whatever options are chosen."""
    todo, seen = {f"run.{verb}"}, set()
    while todo:
        path = todo.pop()
        seen.add(path)
        todo |= references(path, plugins_too) - seen
    return {path.partition(".")[0] for path in seen} & set(GROUPS) - {"run"}


@functools.cache
def files_of(group):
    """Options, and evaluations that experiments alone choose, whose names begin with _."""
    options = dict(registry.catalogue().get(group, {}))
    if group == "evaluation":
        files = (
            file for folder in registry.folders() for file in folder.glob("evaluation/_*.yaml")
        )
        options |= {file.stem: file for file in files if "_target_" in file.read_text("utf-8")}
    return options


@functools.cache
def references(path, plugins_too):
    """Settings that a setting refers to, in any option of its group."""
    first, _, rest = path.partition(".")
    if first == "run":
        return found_in(nodes("run", rest))
    options = files_of(first)
    read = [name for name in options or {} if plugins_too or (first, name) not in OF_EXAMPLES]
    found = [nodes(first, name) for name in read] if options else [whole().get(first)]
    return set().union(*(found_in(part(node, rest)) for node in found))


@functools.cache
def nodes(group, name):
    """What an option sets within its own group, references unresolved."""
    path = files_of(group)[name]
    node = listing.composed(path)
    return node.get(group) if "@package _global_" in path.read_text("utf-8") else node


@functools.cache
def whole():
    return OmegaConf.to_container(config.compose(), resolve=False)


def part(node, path):
    """The part of a node at a path, or what it refers to on the way there."""
    for name in path.split(".") if path else []:
        if not isinstance(node, dict):
            return node
        node = node.get(name)
    return node


def found_in(node):
    if isinstance(node, dict):
        later = {str(node[LATER])} if LATER in node else set()
        return later.union(*map(found_in, node.values()))
    if isinstance(node, list):
        return set().union(*map(found_in, node))
    return set(REFERENCE.findall(node)) if isinstance(node, str) else set()


def test_experiments_and_evaluations_share_no_names():
    shared = set(registry.names("experiment")) & set(registry.names("evaluation"))
    assert shared <= {"object_count"}  # an example of a plugin, with a chapter of its own


def test_the_core_has_few_verbs():
    assert len([verb for verb in VERBS if ("run", verb) not in OF_PLUGINS]) <= 12
