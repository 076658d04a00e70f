"""Every option of every group: it composes, describes itself, and fits what it builds."""

import functools
import inspect
import re
from pathlib import Path

import hydra
import pytest
from hydra._internal import defaults_list
from hydra._internal.hydra import Hydra
from hydra.utils import get_object
from omegaconf import DictConfig, OmegaConf, _utils
from omegaconf import base as omegaconf_base
from omegaconf.basecontainer import BaseContainer
from omegaconf.errors import InterpolationKeyError
from tests.composed import as_typed, base, changes_others, chosen
from tests.test_experiments import NEEDS_INPUT, REPEATED

from scenefw import config, plugins, registry
from scenefw.argument_types import check_types
from scenefw.core.errors import ConfigError
from scenefw.explanations import explain

ROOT = Path(__file__).parents[1]
CATALOGUE = registry.catalogue()


# The default run compares by evaluation=reconstruction and of stacks alone, so others run alone.
FITS_ELSEWHERE = {"renderer", "evaluation", "dataset", "shape"}  # parts of other experiments
CONTEXT = {
    "evaluation": ["run=evaluate"],
    "dataset": ["run=train"],
}


@pytest.fixture(scope="module", autouse=True)
def _plugins():
    plugins.activate()


def targets(node):
    """All nodes with a `_target_`, as plain containers."""
    if isinstance(node, dict):
        if "_target_" in node:
            yield node
        for value in node.values():
            yield from targets(value)


def test_an_option_says_what_it_is():
    for group, options in CATALOGUE.items():
        for name, path in options.items():
            about = registry.description(path)
            assert 10 <= len(about) <= 110, f"conf/{group}/{name}.yaml begins '# what it is'"


def resolved():
    """All options; of those that set keys all over, which Hydra composes, one of each group.

    `tests/test_experiments.py` runs most experiments.
    """
    for group, options in CATALOGUE.items():
        composed = [name for name, path in options.items() if changes_others(path)]
        for name in options:
            rest = pytest.mark.exhaustive if name in composed[1:] else ()
            if group != "experiment" or name in NEEDS_INPUT | REPEATED:
                yield pytest.param(group, name, id=f"{group}={name}", marks=rest)


@pytest.mark.parametrize(("group", "name"), resolved())
def test_an_option_composes_and_resolves(group, name):
    with chosen(group, name, *CONTEXT.get(group, [])) as whole:
        part = whole if changes_others(CATALOGUE[group][name]) else whole.get(group)
        if OmegaConf.is_config(part):
            for node in targets(OmegaConf.to_container(part, resolve=True)):
                assert_fits(node)
        if group in FITS_ELSEWHERE or fits(whole):
            return
    assert any(fits_in(group, name, words) for words in CHAPTERS)


CHAPTERS = ["experiment=label_views", "experiment=label_maps", "experiment=labelling"]


def fits_in(group, name, words):
    with chosen(group, name, words) as whole:
        return fits(whole)


def fits(whole):
    """Whether its parts fit what they are used for in this run."""
    try:
        check_types(whole, "run")
    except ConfigError:
        return False
    return True


@pytest.mark.parametrize("option", ["noise=kinect", "loss=bce", "scene=scattered"])
def test_one_option_in_place_of_another_is_what_hydra_composes(option):
    group, _, name = option.partition("=")
    with chosen(group, name) as whole:
        assert as_written(whole) == as_written(config.compose([as_typed(group, name)]))
    assert as_written(base()) == as_written(config.compose())


def assert_fits(node):
    """The arguments of a config are those of what it builds, and every one has a value."""
    parameters = parameters_of(node["_target_"])
    given = {key for key in node if not key.startswith("_")}
    if not any(p.kind is p.VAR_KEYWORD for p in parameters.values()):
        assert given <= set(parameters), f"{node['_target_']} takes no {given - set(parameters)}"
    needed = {
        name
        for name, p in parameters.items()
        if p.default is p.empty and p.kind not in (p.VAR_KEYWORD, p.VAR_POSITIONAL)
    }
    partial = node.get("_partial_", False)
    assert partial or needed <= given, f"{node['_target_']} needs {needed - given}"


@functools.cache
def parameters_of(target):
    return inspect.signature(get_object(target)).parameters


def test_settings_are_data():
    """No code in YAML: what builds an object names a class of a package, nothing else."""
    for path in ROOT.glob("conf/**/*.yaml"):
        text = path.read_text(encoding="utf-8")
        for banned in ("${eval:", "${oc.create", "lambda", "builtins", "!!python"):
            assert banned not in text, path


def test_experiments_are_short_deltas():
    for path in ROOT.glob("conf/experiment/**/[!_]*.yaml"):
        assert len(path.read_text(encoding="utf-8").splitlines()) <= 32, path
        for entry in OmegaConf.load(path).get("defaults", []):
            assert "experiment" not in str(entry), f"{path.stem} imports another"
            own = isinstance(entry, str)  # a file of this group: only what experiments share
            assert not own or entry.rpartition("/")[2].startswith("_"), f"{path.stem}: {entry}"


@pytest.mark.parametrize("name", registry.names("scale"))
def test_a_scale_sets_sizes_alone(name):
    path = registry.options("scale")[name]
    assert set(OmegaConf.load(path)) == {"size"}
    assert path.read_text(encoding="utf-8").startswith("# @package _global_\n")


def test_a_scale_has_no_size_that_the_root_does_not_explain():
    known = set(OmegaConf.load(config.conf_dir() / "config.yaml").size)
    for path in registry.options("scale").values():
        assert set(OmegaConf.load(path).size) <= known


def as_written(settings):
    """Without what changes from one second to the next."""
    return OmegaConf.to_container(settings, resolve=False)


def test_chapters_do_not_carry_what_another_chose():
    stacks = config.compose(["experiment=simstack"])
    assert as_written(config.compose()) == as_written(stacks)  # the default
    labelling = config.compose(["experiment=labelling"])
    for group in ("model", "learning", "loss"):
        assert group in stacks
        assert group not in labelling
    assert labelling.dataset._target_.endswith("TabletopScenes")
    assert labelling.gallery is None
    assert labelling.showcase._target_.endswith("NoShowcase")
    assert labelling.presentation.package == "scenefw_labelling_studies.report"


def test_settings_stand_once():
    """Fewer than 5 % of all lines stand in a block of five or more that stands elsewhere too."""
    files = sorted(ROOT.glob("conf/**/*.yaml"))
    lines, repeated = repetition([path.read_text(encoding="utf-8") for path in files])
    assert lines > 1000
    assert repeated / lines < 0.05


def test_repetition_is_found():
    block = "a: 1\nb: 2\nc: 3\nd: 4\ne: 5\n"
    assert repetition([block, f"x:\n{block}"]) == (11, 10)
    assert repetition([block, block.replace("c: 3", "c: 4")]) == (10, 0)
    commented = f"x: # y\n{block}".replace("b: 2", "  b: 2 # two")
    assert repetition([f"# a\n{block}", commented]) == (11, 10)


def repetition(texts, least=5):
    """Lines of settings, and how many of them are in repeated blocks of `least` lines."""
    places = {}
    files = [[line for raw in text.splitlines() if (line := plain(raw))] for text in texts]
    for number, lines in enumerate(files):
        for start in range(len(lines) - least + 1):
            places.setdefault(tuple(lines[start : start + least]), []).append((number, start))
    several = (place for found in places.values() if len(found) > 1 for place in found)
    repeated = {(number, start + i) for number, start in several for i in range(least)}
    return sum(map(len, files)), len(repeated)


def plain(line):
    """A line without comment and indentation."""
    return re.sub(r"(^|\s)#.*", "", line).strip()


@pytest.mark.parametrize("name", ["label_views", "label_maps"])
def test_experiments_that_label_have_both_scales(name):
    small, large = (config.compose([f"experiment={name}", *s]) for s in ((), ("scale=thesis",)))
    for part, widths, batch, average in ((small, 16, 8, 0.99), (large, 48, 32, 0.999)):
        assert part.learning._target_.endswith("SegmentationLearning")
        assert part.learning.optimizer._target_.endswith("AdamW")  # Muon is untried for labels
        assert part.learning.average == average
        assert part.model.widths[0] == widths
        assert part.model.scale == 0.02
        assert part.dataset.batch_size == batch
    assert large.trainer.max_epochs == 20
    stacks = config.compose(["experiment=simstack", "scale=thesis"])
    assert stacks.trainer.max_epochs == 130
    assert stacks.learning.optimizer._target_.endswith("Muon")


def test_scale_gives_way_to_experiment_and_that_to_debug():
    order = [str(next(iter(e))) for e in _defaults() if isinstance(e, DictConfig)]
    last = [key.removeprefix("optional ") for key in order if "hydra" not in key][-3:]
    assert last == ["scale", "experiment", "debug"]


def _defaults():
    return OmegaConf.load(config.conf_dir() / "config.yaml").defaults


def test_registry_builds_with_changed_arguments():
    renderer = registry.build("renderer", "mesh_raycaster", contrast=0.3)
    assert renderer.contrast == 0.3


@pytest.mark.parametrize(
    ("words", "expected"),
    [
        (("endgine", "pybullet"), "did you mean engine"),
        (("engine", "pybulet"), "did you mean pybullet"),
        (("engine", "pybullet", "gravty"), "did you mean gravity"),
    ],
)
def test_registry_names_near_misses(words, expected):
    group, name, *arguments = words
    with pytest.raises(config.ConfigError, match=expected):
        registry.build(group, name, **dict.fromkeys(arguments, 1))


def test_parts_of_maps_are_chosen_as_typed():
    words = ["run=label", "labelling=image_space"]
    settings = OmegaConf.to_container(config.compose(words), resolve=True)["run"]
    assert settings["strategies"]["image_space"]["labels"]["_target_"].endswith("ImageSpaceFusion")
    assert settings["odometry"]["_target_"].endswith("RGBDOdometry")


@pytest.mark.parametrize("missing", ["learning", "model", "dataset"])
def test_what_nothing_chooses_is_named(missing):
    chosen = {"learning": "shape_instance", "model": "shape_instance_vae", "dataset": "stacks"}
    words = [f"{group}={name}" for group, name in chosen.items() if group != missing]
    whole = config.compose(["~experiment", "run=train", *words])
    with pytest.raises(InterpolationKeyError) as raised:
        OmegaConf.to_container(whole.run, resolve=True)
    options = {group: sorted(found) for group, found in registry.catalogue().items()}
    line = str(explain(raised.value, [], options))
    assert line.startswith(f"no {missing} is chosen; give {missing}=")


@pytest.mark.parametrize("run", ["evaluate", "pipeline", "train_and_evaluate"])
def test_matching_is_chosen_for_all_that_compares_stacks(run):
    whole = config.compose([f"run={run}", "matching._target_=a.plugin.Matching"])
    resolved = OmegaConf.to_container(whole, resolve=True)
    read = {"run": resolved["run"], "built later": resolved["evaluation"]}
    found = [node["matching"]["_target_"] for node in nodes_with(read, "matching")]
    assert found
    assert set(found) == {"a.plugin.Matching"}


def nodes_with(node, key):
    """All parts that have a key, as plain containers."""
    if isinstance(node, dict):
        if key in node:
            yield node
        for value in node.values():
            yield from nodes_with(value, key)


@pytest.mark.parametrize(
    ("words", "text", "asked"),
    [
        (["seed=1"], "a: 1\n", False),
        (["hydra.mode=MULTIRUN"], "a: 1\n", True),
        (["experiment=sweep"], "hydra:\n  mode: MULTIRUN\n", True),
    ],
)
def test_hydra_looks_for_its_mode_where_one_is_set(tmp_path, monkeypatch, words, text, asked):
    (tmp_path / "experiment").mkdir()
    (tmp_path / "experiment" / "sweep.yaml").write_text(text)
    monkeypatch.setattr(Hydra, "get_mode", lambda *_: "asked")
    config.compose_once(words, [tmp_path])
    assert (Hydra.get_mode(None) == "asked") == asked


@pytest.fixture
def without_shortcut(monkeypatch):
    """Hydra's and OmegaConf's own ways to compose."""
    config.compose_lean()
    complete = defaults_list._create_interpolation_map.__wrapped__
    monkeypatch.setattr(config, "compose_lean", lambda: None)

    def use():
        monkeypatch.setattr(defaults_list, "_create_interpolation_map", complete)
        monkeypatch.delattr(BaseContainer, "_re_parent")
        for module in (omegaconf_base, _utils):
            monkeypatch.setattr(module, "parse", module.parse.__wrapped__)

    return use


@pytest.mark.parametrize("words", [["experiment=labelling"], ["experiment=label_maps", "seed=3"]])
def test_compositions_are_those_without_the_shortcut(without_shortcut, words):
    short = config.compose(words)
    assert all(node._get_parent() is parent for parent, node in nodes_below(short))
    without_shortcut()
    assert repr(config.compose(words)) == repr(short)


def nodes_below(container):
    """Pairs of a container and a node in it, on all levels."""
    content = container._content
    nodes = content.values() if isinstance(content, dict) else content
    for node in nodes if isinstance(content, dict | list) else ():
        yield container, node
        if isinstance(node, BaseContainer):
            yield from nodes_below(node)


def test_a_choice_may_refer_to_another(tmp_path, monkeypatch, without_shortcut):
    root = "defaults:\n  - kind: one\n  - again: ${kind}\n  - _self_\nseen: true\n"
    (tmp_path / "config.yaml").write_text(root)
    for group in ("kind", "again"):
        (tmp_path / group).mkdir()
        for name in ("one", "two"):
            (tmp_path / group / f"{name}.yaml").write_text(f"name: {name}\n")
    monkeypatch.setattr(config, "conf_dir", lambda: tmp_path)
    for words, expected in (([], "one"), (["kind=two"], "two"), (["kind=one", "again=two"], "two")):
        assert config.compose(words).again.name == expected
    without_shortcut()
    assert config.compose(["kind=two"]).again.name == "two"


def test_no_setting_of_the_core_asks_for_a_sweep():
    """What `compose_once` relies on: the chosen mode comes from the command line alone."""
    with hydra.initialize_config_dir(str(config.conf_dir()), version_base="1.3"):
        assert hydra.compose("config", return_hydra_config=True).hydra.mode is None
