"""The documents: links, commands, pictures drawn by code, and the site made of them."""

import copy
import functools
import importlib.util
import os
import re
import shlex
import subprocess
import sys
from html.parser import HTMLParser
from pathlib import Path
from urllib.parse import unquote, urlsplit

import pytest

from scenefw import completion, registry
from scenefw.renamed_settings import instead_of, new_name

ROOT = Path(__file__).parents[1]
TOP = [ROOT / name for name in ("README.md", "CHANGELOG.md", "CONTRIBUTING.md")]
PAGES = [*TOP, *sorted(ROOT.glob("docs/**/*.md")), *sorted(ROOT.glob("plugins/*/README.md"))]
COMMAND = re.compile(r"^(?:\w+=\S* )*(?:python -m )?scenefw (.+)$")


def without_code(text):
    return re.sub(r"^```.*?^```$|`[^`\n]*`", "", text, flags=re.MULTILINE | re.DOTALL)


def anchors(page):
    """As a code host names headings."""
    text = re.sub(r"^```.*?^```$", "", page.read_text(encoding="utf-8"), flags=re.M | re.S)
    headings = re.findall(r"^#+ (.*)$", text, re.MULTILINE)
    return {re.sub(r"[^\w\- ]", "", line.lower()).replace(" ", "-") for line in headings}


def test_links_lead_somewhere_on_a_code_host():
    anchors_of = functools.cache(anchors)
    for page in PAGES:
        text = without_code(page.read_text(encoding="utf-8"))
        for target in re.findall(r"\]\(([^)\s]+)\)", text):
            if urlsplit(target).scheme:
                continue
            path, _, anchor = target.partition("#")
            linked = (page.parent / path).resolve() if path else page
            assert linked.exists(), f"{page.name}: {target}"
            assert linked.is_relative_to(ROOT), f"{page.name}: {target}"
            assert not anchor or anchor in anchors_of(linked), f"{page.name}: {target}"


def commands():
    """Words of all commands in the documents."""
    found = {}
    for page in PAGES:
        text = page.read_text(encoding="utf-8").replace("\\\n", " ")
        blocks = re.findall(r"^```(\w*)\n(.*?)^```$", text, re.MULTILINE | re.DOTALL)
        for block in (block for language, block in blocks if language in {"", "sh"}):
            lines = filter(None, map(COMMAND.match, block.splitlines()))
            found |= {line[1]: page for line in lines if "litres" not in line[1]}  # of the guide
    return found


def as_called_now(word):
    key, _, value = word.partition("=")
    new = new_name(key, value)
    return word if new is None else new if "=" in new else f"{new}={value}"


@pytest.mark.exhaustive
def test_commands_name_options_and_settings_that_exist(monkeypatch):
    read = functools.cache(registry.settings)
    monkeypatch.setattr(registry, "settings", lambda path: copy.deepcopy(read(path)))
    options, found = registry.catalogue(), commands()
    monkeypatch.setattr(registry, "catalogue", lambda: options)
    assert len(found) > 80
    for command, page in found.items():
        words = [word for word in shlex.split(command, comments=True) if "=" in word]
        if page.is_relative_to(ROOT / "docs" / "results"):  # as they were called then
            there = (word for word in words if instead_of(*word.split("=", 1)) is None)
            words = [as_called_now(word) for word in there]
        plain = (word for word in words if word[0] not in "+~-" and "@" not in word)
        for word in (word for word in plain if not word.startswith("hydra.")):
            key, _, value = word.partition("=")
            typed = f"scenefw {' '.join(w for w in words if w != word)}"
            where = f"{page.name}: {command}: {word}"
            if key not in options:
                assert f"{key}=" in completion.answers(f"{typed} {key}") or (
                    f"{key}." in completion.answers(f"{typed} {key}")
                ), where
            elif not value.isupper() and value != "null":
                assert set(value.strip("[]").split(",")) <= options[key].keys(), where


def test_the_picture_of_the_data_is_current():
    script = ROOT / "docs" / "hooks" / "flow.py"
    spec = importlib.util.spec_from_file_location("flow", script)
    spec.loader.exec_module(flow := importlib.util.module_from_spec(spec))
    assert (ROOT / "docs" / "flow.svg").read_text(encoding="utf-8") == flow.draw()


def test_the_readme_is_short_and_has_what_commands_fill():
    text = (ROOT / "README.md").read_text(encoding="utf-8")
    assert text.count("\n") <= 120
    for mark in ("headline", "pictures"):
        assert text.count(f"<!-- {mark} -->") == text.count(f"<!-- /{mark} -->") == 1


@pytest.mark.exhaustive
def test_the_quickstart_leads_to_a_scene(scenefw, tmp_path, warm):
    text = (ROOT / "docs" / "quickstart.md").read_text(encoding="utf-8")
    (script,) = re.findall(r"^```python\n(.*?)^```$", text, re.MULTILINE | re.DOTALL)
    (tmp_path / "blocks.py").write_text(script)
    assert warm("blocks", [], tmp_path, dict(os.environ)).returncode == 0
    lines = re.findall(r"^```sh\npython -m scenefw (.*?)\n```$", text, re.MULTILINE)
    assert len(lines) == 2
    for line in lines:
        done = scenefw(*shlex.split(line), "device=cpu")
        assert done.returncode == 0, done.stderr
    assert "blocks.npz: usable" in scenefw(*shlex.split(lines[0]), "device=cpu").stdout
    made = tmp_path / "outputs" / "blocks" / "blocks"
    files = ["scene.glb", "object_01.ply", "object_02.ply", "scene.json", "masks.png"]
    assert [name for name in files if not (made / name).is_file()] == []
    assert not (made / "object_03.ply").exists()
    assert (made / "overview.png").stat().st_size > 100_000


class Page(HTMLParser):
    """Anchors, links and what the browser fetches of a page."""

    def __init__(self, path):
        super().__init__()
        self.anchors, self.links, self.fetched, self.text = set(), [], [], []
        self.feed(path.read_text(encoding="utf-8"))

    def handle_starttag(self, tag, attributes):
        found = dict(attributes)
        self.anchors |= {found[key] for key in ("id", "name") if found.get(key)}
        if tag == "a" and found.get("href"):
            self.links.append(found["href"])
        elif tag in {"script", "link", "img", "source", "iframe"}:
            self.fetched += [found[key] for key in ("src", "href") if found.get(key)]

    def handle_data(self, data):
        self.text.append(data)


@pytest.fixture(scope="module")
def site(tmp_path_factory):
    """Pages by path; warnings of mkdocs are errors."""
    folder = tmp_path_factory.mktemp("site")
    words = [sys.executable, "-m", "mkdocs", "build", "--strict", "--site-dir", str(folder)]
    env = {**os.environ, "NO_MKDOCS_2_WARNING": "1"}
    done = subprocess.run(words, cwd=ROOT, env=env, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    return {path: Page(path) for path in folder.rglob("*.html") if path.name != "404.html"}


@pytest.mark.exhaustive
def test_the_site_is_whole_and_fetches_nothing_from_elsewhere(site):
    assert len(site) > 25
    for path, page in site.items():
        for target in page.fetched:
            assert not urlsplit(target).netloc, f"{path.name}: {target}"
        for target in (*page.fetched, *page.links):
            parts = urlsplit(target)
            if parts.scheme or parts.netloc:
                continue
            linked = (path.parent / unquote(parts.path)).resolve() if parts.path else path
            linked = linked / "index.html" if linked.is_dir() else linked
            assert linked.exists(), f"{path.name}: {target}"
            if parts.fragment and linked in site and parts.fragment != "__skip":
                assert unquote(parts.fragment) in site[linked].anchors, f"{path.name}: {target}"


@pytest.mark.exhaustive
def test_the_catalogue_has_every_option_with_its_line(site):
    (page,) = (page for path, page in site.items() if path.name == "catalogue.html")
    text = " ".join("".join(page.text).split())
    for group, options in registry.catalogue().items():
        assert group in page.anchors
        assert registry.group(group).about.replace("`", "") in text
        for name, path in options.items():
            assert f"{group}={name}" in text
            about = registry.description(path).partition(" (plugin ")[0]
            assert about.replace("`", "") in text, f"{group}={name}"


@pytest.mark.exhaustive
def test_tables_and_lists_are_not_left_as_text(site):
    """Where a blank line is missing, a site shows as text what a code host shows as a table."""
    for path, page in site.items():
        shown = "".join(page.text)
        assert "| ---" not in shown, path.name
        assert not re.search(r"^- \S.*\n- ", re.sub(r"\s*\n", "\n", shown), re.M), path.name
