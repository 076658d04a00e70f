"""Where the weights and the example are that come with scenefw and its plugins."""

from collections.abc import Iterable
from importlib import resources
from pathlib import Path

SUFFIX = ".safetensors"
EXAMPLE = "example"
"""What the depth image that comes with scenefw is called on the command line and in Python."""
_folders: list[Path] = []  # of plugins


def search_also(folders: Iterable[Path]) -> None:
    """Makes weights in these folders known by name, after those of scenefw itself."""
    _folders.extend(folder for folder in folders if folder not in _folders)


def folders() -> tuple[Path, ...]:
    """All folders that are searched, scenefw's first."""
    return (Path(str(resources.files("scenefw") / "assets")), *_folders)


def weights() -> dict[str, list[Path]]:
    """Files by name; several where packages use the same name."""
    paths: dict[str, list[Path]] = {}
    for folder in folders():
        for path in sorted(folder.glob(f"*{SUFFIX}")):
            paths.setdefault(path.stem, []).append(path)
    return paths


def example_image() -> Path:
    """The depth image that comes with scenefw: household things before a simulated Kinect."""
    return folders()[0] / f"{EXAMPLE}.npz"


def image_path(path: Path | str) -> Path:
    """The path, `~` expanded; the example's if it is called so and no file or folder is."""
    path = Path(path).expanduser()
    return example_image() if str(path) == EXAMPLE and not path.exists() else path
