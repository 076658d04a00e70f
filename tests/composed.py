"""Settings of many options from few compositions by Hydra, since each takes a quarter second."""

import contextlib
import functools
import re

from omegaconf import DictConfig, ListConfig, OmegaConf, open_dict

from scenefw import config, listing, plugins, registry


@functools.cache
def every():
    """`{group: {name: settings}}` of options that set nothing outside their group, by Hydra."""
    plugins.activate()
    batches = [[]]  # all in one composition, but for what Hydra takes once for several options
    for group, options in registry.catalogue().items():
        for name, path in options.items():
            if is_global(path):
                continue
            word = f"+{group}@every.{group}.{name}={name}"
            if shares(path):
                batches.append([word])
            else:
                batches[0].append(word)
    found = {}
    for words in batches:
        part = config.compose(["~experiment", *words]).every
        for group, options in container(part).items():
            found.setdefault(group, {}).update(options)
    return found


def shares(path):
    """Whether an option, or one of its group that it is made of, sets what several share."""
    text = path.read_text(encoding="utf-8")
    made_of = [
        path.with_name(f"{name}.yaml") for name in re.findall(r"^  - (\w+)\b(?!@)", text, re.M)
    ]
    return "@_global_.shared" in text or any(one.is_file() and shares(one) for one in made_of)


@functools.cache
def option(group, name):
    """What Hydra makes of one option, without Hydra; `tests/test_listing.py` compares."""
    return listing.composed(registry.options(group)[name])


def is_global(path):
    """Whether an option sets keys all over the settings, as experiments do."""
    return "@package _global_" in path.read_text(encoding="utf-8")


def changes_others(path):
    """Whether an option sets or chooses something outside its group."""
    return is_global(path) or "override /" in path.read_text(encoding="utf-8")


@functools.cache
def base(*words):
    """The settings with these overrides; nobody may change them."""
    plugins.activate()
    return config.compose(words)


@contextlib.contextmanager
def chosen(group, name, *words):
    """The settings with these overrides and one option more; equal to what Hydra composes."""
    path = registry.options(group)[name]
    if changes_others(path):
        yield config.compose([*words, as_typed(group, name)])
        return
    whole = base(*words)
    before = whole.get(group)
    known = group in whole
    with open_dict(whole):
        whole[group] = option(group, name)
        try:
            yield whole
        finally:
            if known:
                whole[group] = before
            else:
                del whole[group]


def as_typed(group, name):
    """The override that chooses an option."""
    several = isinstance(default_option(group), list)
    return f"{group}=[{name}]" if several else f"{group}={name}"


@functools.cache
def default_option(group):
    """What `config.yaml` chooses of a group; a list for groups used several at a time."""
    for entry in OmegaConf.load(config.conf_dir() / "config.yaml").defaults:
        if isinstance(entry, DictConfig):
            for key, value in entry.items():
                if key.removeprefix("optional ") == group:
                    return list(value) if isinstance(value, ListConfig) else value
    raise AssertionError(f"conf/config.yaml chooses nothing of {group}; add `{group}: null`")


def container(node):
    """As plain dictionaries and lists, references unresolved."""
    return OmegaConf.to_container(node, resolve=False)
