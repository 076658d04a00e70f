"""three.js as text, to put into pages: they then need neither a server nor a network."""

from functools import cache
from pathlib import Path
from zipfile import BadZipFile, ZipFile

from scenefw.core.errors import MissingDependencyError

_BEGINNING, _END = "<script>", "THREE.GLTFLoader=GLTFLoader;})();"


@cache
def three_js() -> str:
    """The build of three.js (MIT licence) that trimesh ships for its own viewer; it makes `THREE`.

    Raises:
        MissingDependencyError: trimesh is not installed, or ships another one.
    """
    try:
        import trimesh

        archive = Path(trimesh.__file__).parent / "resources" / "templates" / "viewer.zip"
        with ZipFile(archive) as files:
            page = files.read("viewer.html.template").decode("utf-8")
        beginning = page.index(_BEGINNING) + len(_BEGINNING)
        return page[beginning : page.index(_END, beginning) + len(_END)]
    except (ImportError, OSError, KeyError, ValueError, BadZipFile) as error:
        raise MissingDependencyError(
            "pages to turn scenes in need the three.js of trimesh: pip install 'trimesh==5.2.0'"
        ) from error
