"""What mkdocs adds to docs/*.md: documents from elsewhere in the project, links, the catalogue."""

import logging
import posixpath
import re
import tomllib
from pathlib import Path

from mkdocs.structure.files import File

from scenefw import plugins, registry

ROOT = Path(__file__).parents[2]
ELSEWHERE = {"README.md": "index.md", "CHANGELOG.md": "changelog.md",
             "CONTRIBUTING.md": "contributing.md"}  # fmt: skip
CATALOGUE = "<!-- catalogue -->"
LINK = re.compile(r"(!?)\[([^\]]*)\]\(([^)\s]+)\)")
CODE = re.compile(r"(^```.*?^```$|`[^`\n]+`(?!\]))", re.MULTILINE | re.DOTALL)
log = logging.getLogger("mkdocs.hooks.pages")  # warnings end a strict build


def moved():
    """Pages of the site that lie outside docs/, by their path in the project."""
    cards = {p.relative_to(ROOT).as_posix(): f"cards/{p.name}" for p in cards_of_weights()}
    readmes = ROOT.glob("plugins/*/README.md")
    own = {p.relative_to(ROOT).as_posix(): f"plugins/{p.parent.name}.md" for p in readmes}
    return ELSEWHERE | cards | own


def cards_of_weights():
    """Those of the core and of plugins that are part of its wheel; examples stand by themselves."""
    bundled = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
    packages = bundled["tool"]["hatch"]["build"]["targets"]["wheel"]["packages"]
    return sorted(card for package in packages for card in (ROOT / package / "assets").glob("*.md"))


def on_config(config):
    """Puts pages that the navigation doesn't name under "More"."""
    named = set(re.findall(r"[\w/]+\.md", str(config.nav)))
    docs = Path(config.docs_dir)
    pages = [p.relative_to(docs).as_posix() for p in docs.rglob("*.md")]
    rest = sorted((set(pages) | set(moved().values())) - named)
    if rest:
        config.nav.append({"More": rest})
    return config


def on_files(files, config):
    for path, page in moved().items():
        text = (ROOT / path).read_text(encoding="utf-8")
        files.append(File.generated(config, page, content=text))
    return files


def on_page_markdown(text, page, config, files):
    pages = moved()
    origins = {site: path for path, site in pages.items()}
    origin = origins.get(page.file.src_uri, f"docs/{page.file.src_uri}")

    def link(match):
        return linked(match, origin, page.file.src_uri, pages, config.repo_url)

    parts = CODE.split(text.replace(CATALOGUE, catalogue()))
    text = "".join(part if i % 2 else LINK.sub(link, part) for i, part in enumerate(parts))
    return re.sub(r"^(<!-- .* -->)$", r"\n\1\n", text, flags=re.MULTILINE)


def linked(match, origin, site, pages, repository):
    """A link as the site needs it: to a page, to the repository, or, if that is unknown, its words.

    Args:
        match: of the link.
        origin: path in the project of the document that it is in.
        site: path of its page.
        pages: those from outside docs/, by path in the project.
        repository: URL, or None.
    """
    picture, words, target = match.groups()
    path, mark, anchor = target.partition("#")
    if not path or re.match(r"\w+:", target):
        return match[0]
    found = posixpath.normpath(posixpath.join(posixpath.dirname(origin), path))
    if not (ROOT / found).exists():
        log.warning("%s links to %s, which doesn't exist", origin, target)
    found = next((f for f in (found, f"{found}/README.md") if f in pages), found)
    page = pages.get(found, found.removeprefix("docs/") if found.startswith("docs/") else None)
    if page:
        inside = posixpath.relpath(page, posixpath.dirname(site) or ".")
        return f"{picture}[{words}]({inside}{mark}{anchor})"
    if repository:
        return f"[{words}]({repository.rstrip('/')}/blob/main/{found})"
    return words if words.strip("`") in found else f"{words} (`{found}`)"


def catalogue():
    """Every group with its options, as `--list` shows them, in Markdown."""
    owners = {pair: plugin.name for plugin in plugins.find() for pair in plugin.options()}
    lines = []
    for group, options in registry.catalogue().items():
        info = registry.group(group)
        verbs = ", ".join(f"`run={verb}`" if verb != "any" else "any run" for verb in info.verbs)
        package = info.package if info.package.startswith("scenefw_") else f"scenefw.{info.package}"
        where = f" Classes: `{package}`." if info.package else ""
        read = f" Read by {verbs}." if verbs else ""
        lines += [f"## {group}", "", f"{info.about}.{read}{where}", ""]
        lines += ["| option | what it is |", "| --- | --- |"]
        for name, path in sorted(options.items()):
            owner = f" (plugin {owners[group, name]})" if (group, name) in owners else ""
            about = registry.description(path).removesuffix(owner).replace("|", "\\|")
            lines.append(f"| `{group}={name}` | {about}{owner} |")
        lines.append("")
    return "\n".join(lines)
