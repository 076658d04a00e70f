"""Pictures of predictions on real images for a document; the images themselves are not copied."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from scenefw.core.errors import ConfigError, InputError
from scenefw.core.files import require_name, require_writable
from scenefw.report.pictures import as_image, save_for_document
from scenefw.tasks.predict import Predict
from scenefw_publishing.markers import fill, read_document
from scenefw_publishing.two_sides import draw_two_sides

_LARGEST = 50_000  # bytes
_COLUMNS = 2
_MARKER = "pictures"


@dataclass(frozen=True)
class Shown:
    """A picture to make.

    Args:
        image: depth image, relative to the input.
        words: what stands there, one line.
    """

    image: str
    words: str


class Pictures:
    """Draws predictions on real images from two sides, and puts the pictures into a document.

    The document gets a table of pictures between `<!-- pictures -->` and `<!-- /pictures -->`. The
    run's folder gets what `run=predict` writes, the image among it, which is not published.

    Args:
        predict: predicts an image.
        images: by name of the picture: `image`, relative to the input of `predict`, and `words`.
        document: that shows them, e.g. README.md.
        folder: where they go, below that of the document.

    Raises:
        ConfigError: there is no image to show, or an entry is unusable.
    """

    def __init__(
        self,
        predict: Predict,
        images: Mapping[str, Mapping[str, str]],
        document: str | Path = "README.md",
        folder: str | Path = "docs/results/real",
    ) -> None:
        self.predict, self.document, self.folder = predict, Path(document), Path(folder)
        try:
            self.images = {name: Shown(**entry) for name, entry in images.items() if entry}
        except TypeError as error:
            raise ConfigError(f"an entry of publishing.images is invalid: {error}") from error
        for name in self.images:
            require_name(name, "publishing.images")
        if not self.images:
            raise ConfigError("publishing.images names no image to show")

    def run(self) -> dict[str, float]:
        """Writes pictures and document; returns the number of objects by picture.

        Raises:
            InputError: an image is missing or unusable.
            StorageError: the document has no place for them, or something can't be written.
        """
        read_document(self.document, _MARKER)
        missing_images = [s.image for s in self.images.values() if not self._path(s).is_file()]
        if missing_images:
            raise InputError(
                f"no image {missing_images[0]} in {self.predict.images.path}; give the folder "
                "above as input=FOLDER, or other images as publishing.images"
            )
        target = require_writable(self.document.parent / self.folder)
        counts = {name: self._draw(name, picture, target) for name, picture in self.images.items()}
        cells = [self._cell(name, picture, counts[name]) for name, picture in self.images.items()]
        fill(self.document, _MARKER, in_columns(cells, _COLUMNS))
        return {f"{name}/objects": float(count) for name, count in counts.items()}

    def _path(self, picture: Shown) -> Path:
        return self.predict.images.path / picture.image

    def _draw(self, name: str, picture: Shown, target: Path) -> int:
        estimate = self.predict.predict(self._path(picture), self.predict.output / name)
        path = target / f"{name}.webp"
        save_for_document(as_image(draw_two_sides(estimate)), path)
        if path.stat().st_size > _LARGEST:
            print(f"{path} has {path.stat().st_size / 1e3:.0f} kB, too large for a document")
        return len(estimate.objects)

    def _cell(self, name: str, picture: Shown, count: int) -> tuple[str, str]:
        words = f"{picture.words}: {count} object{'' if count == 1 else 's'} found"
        return f"![{words}]({self.folder.as_posix()}/{name}.webp)", words


def in_columns(cells: Sequence[tuple[str, str]], columns: int) -> str:
    """Markdown of pictures side by side, each with its caption below."""
    rows = []
    for start in range(0, len(cells), columns):
        part = [*cells[start : start + columns], *[("", "")] * columns][:columns]
        rows += [f"| {' | '.join(entries)} |" for entries in zip(*part, strict=True)]
    rows.insert(1, "| " + " | ".join(["---"] * columns) + " |")
    return "\n".join(rows)
