"""Every option of every group: it composes, describes itself, and fits what it builds."""

import inspect
from pathlib import Path

import pytest
from hydra.utils import get_object
from omegaconf import DictConfig, ListConfig, OmegaConf

from scenefw import config, plugins, registry
from scenefw.argument_types import check_types

ROOT = Path(__file__).parents[1]
OPTIONS = [
    pytest.param(group, name, id=f"{group}={name}")
    for group, options in registry.catalogue().items()
    for name in options
]


# The default run compares by evaluation=reconstruction and of stacks alone, so others run alone.
FITS_ELSEWHERE = {
    "mapping",
    "renderer",
    "evaluation",
    "dataset",
    "shape",
}  # parts of other experiments
CONTEXT = {"evaluation": ["run=evaluate"], "dataset": ["run=train"]}


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


@pytest.mark.parametrize(("group", "name"), OPTIONS)
def test_an_option_says_what_it_is(group, name):
    about = registry.describe(group, name)
    assert 10 <= len(about) <= 110, f"first line of conf/{group}/{name}.yaml: '# what it is'"


@pytest.mark.parametrize(("group", "name"), OPTIONS)
def test_an_option_composes_and_resolves(group, name):
    several = isinstance(default_option(group), list)
    chosen = f"{group}=[{name}]" if several else f"{group}={name}"
    whole = config.compose([chosen, *CONTEXT.get(group, [])])
    resolved = OmegaConf.to_container(whole, resolve=True)
    for node in targets(resolved):
        assert_fits(node)
    if group not in FITS_ELSEWHERE:
        check_types(whole, "run")


def default_option(group):
    """What `config.yaml` chooses of a group; a list for groups used several at a time."""
    for entry in _defaults():
        if isinstance(entry, DictConfig):
            for key, value in entry.items():
                if key.removeprefix("optional ") == group:
                    return list(value) if isinstance(value, ListConfig) else value
    pytest.fail(f"conf/config.yaml chooses nothing of group {group}; add `{group}: null`")


def assert_fits(node):
    """The arguments of a config are those of what it builds, and every one has a value."""
    built = get_object(node["_target_"])
    parameters = inspect.signature(built).parameters
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


@pytest.mark.parametrize("path", sorted(ROOT.glob("conf/**/*.yaml")), ids=lambda p: p.stem)
def test_settings_are_data(path):
    """No code in YAML: what builds an object names a class of a package, nothing else."""
    text = path.read_text(encoding="utf-8")
    for banned in ("${eval:", "${oc.create", "lambda", "builtins", "!!python"):
        assert banned not in text


@pytest.mark.parametrize("path", sorted(ROOT.glob("conf/experiment/*.yaml")), ids=lambda p: p.stem)
def test_experiments_are_short_deltas(path):
    assert len(path.read_text(encoding="utf-8").splitlines()) <= 45


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


def test_every_group_is_in_the_list_of_groups():
    assert set(registry.catalogue()) <= set(registry.PACKAGES)


def test_scale_gives_way_to_experiment_and_that_to_debug():
    order = [str(next(iter(e))) for e in _defaults() if isinstance(e, DictConfig)]
    last = [key.removeprefix("optional ") for key in order if "hydra" not in key][-4:]
    assert last == ["scale", "experiment", "ablation", "debug"]


def _defaults():
    return OmegaConf.load(config.conf_dir() / "config.yaml").defaults


def test_registry_builds_with_changed_arguments():
    grid = registry.build("grid", "default", resolution=16)
    assert grid.shape == (16, 16, 16)


@pytest.mark.parametrize(
    ("words", "expected"),
    [
        (("gird", "default"), "did you mean grid"),
        (("grid", "defalt"), "did you mean default"),
        (("grid", "default", "resoluton"), "did you mean resolution"),
    ],
)
def test_registry_names_near_misses(words, expected):
    group, name, *arguments = words
    with pytest.raises(config.ConfigError, match=expected):
        registry.build(group, name, **dict.fromkeys(arguments, 1))


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
