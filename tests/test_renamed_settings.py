"""Who types a name that a setting or an option had before is told the new one."""

import re

import pytest
from omegaconf import OmegaConf
from tests.composed import base

from scenefw import config, plugins, registry
from scenefw.renamed_settings import DELETED, OPTIONS, VIEWS, instead_of, new_name

CATALOGUE = registry.catalogue()


def exists(option):
    group, _, name = option.partition("=")
    return name in CATALOGUE.get(group.partition("@")[0], {})


def test_old_names_are_no_options_anymore_and_new_ones_are():
    assert [old for old in (*OPTIONS, *DELETED) if exists(old)] == []
    assert [new for new in OPTIONS.values() if not exists(new)] == []


def test_what_to_give_instead_of_what_was_deleted_exists():
    for old in DELETED:
        group, _, name = old.partition("=")
        assert new_name(group, name) is None
        for word, option in re.findall(r"\b(\w+)=([\w/]+)", instead_of(group, name)):
            assert option in CATALOGUE.get(word, {option}), old


@pytest.mark.parametrize("network", ["sets", "parts", "scenes"])
def test_checkpoints_are_called_as_their_networks(network):
    known = base("~experiment").checkpoints
    assert network not in known
    assert new_name(f"checkpoints.{network}", "FILE").removeprefix("checkpoints.") in known


def test_each_evaluation_has_rows_named_by_method():
    plugins.activate()
    for name, part in {
        "evaluation=reconstruction": "evaluation.methods.drawn_codes",
        "evaluation=object_sets": "evaluation.methods.set_network",
        "evaluation=stacks_noisy_scattered": "evaluation.parts.noisy.methods.network",
    }.items():
        *path, method = part.split(".")
        node = config.compose(["run=evaluate", name])
        for key in path:
            node = node[key]
        assert method in node
        assert "scenefw" not in node


@pytest.mark.parametrize(
    ("old", "said"),
    [
        ("dataset=seen_sets", "has another name now; give dataset=set_flow "),
        ("logger=[csv]", "was deleted; give logger.NAME=null to leave one out, "),
        ("map_label_source=by_rule", "was deleted; give label_source@map_label_source=by_rule"),
        ("checkpoints.sets=FILE", "has another name now; give checkpoints.set_extents=FILE "),
        (
            "evaluation.methods.scenefw.suppress=0.5",
            "has another name now; give evaluation.methods.set_network.suppress=0.5 ",
        ),
        ("reconstructor=object_queries", "was deleted; give reconstructor=set_extents"),
        ("checkpoints.image_queries=FILE", "was deleted; give reconstructor=set_extents"),
        ("ablation=unobserved", "was deleted; give the settings that it changed"),
    ],
)
def test_what_has_another_name_or_none_is_one_line_and_status_2(scenefw, tmp_path, old, said):
    done = scenefw("experiment=table_6_2", old, "paths.output=out")
    assert done.returncode == 2
    (line,) = done.stderr.strip().splitlines()
    assert f"{old} {said}" in line
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize(
    ("key", "alone", "views"),
    [
        (
            "run.pipeline.doctor.nearest",
            "observer.doctor.min_distance",
            "run.pipeline.observer.doctor.min_distance",
        ),
        (
            "run.pipeline.workspace.min_pixels",
            "observer.workspace.min_pixels",
            "run.pipeline.observer.workspace.min_pixels",
        ),
        ("run.pipeline.mapping.truncation", "mapping.truncation", "mapping.truncation"),
        ("run.pipeline.floor", "floor", "run.pipeline.observer.table"),
        ("run.pipeline.samples", "reconstructor.samples", None),
        ("checkpoints.sets", "checkpoints.set_extents", "checkpoints.set_extents"),
    ],
)
def test_one_view_and_several_have_their_own_names(key, alone, views):
    assert new_name(key, "1") == alone
    assert new_name(key, "1", views=True) == views


def test_new_names_of_several_views_can_be_set():
    settings = base("run=decompose")
    for old in VIEWS:
        assert OmegaConf.select(settings, new_name(old, "", views=True)) is not None, old
