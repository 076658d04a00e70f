"""Writes a document's table of figures of the shipped weights."""

from collections.abc import Mapping, Sequence
from pathlib import Path

from scenefw.core import assets
from scenefw.core.errors import InputError
from scenefw.learning.provenance import digest
from scenefw_publishing.kept import kept_parts, require_known
from scenefw_publishing.markers import body, fill, read_document
from scenefw_publishing.stored import StoredRun, read_runs
from scenefw_publishing.summary import Summary, parts_in
from scenefw_publishing.table import headline

_MARKER = "headline"


class Headline:
    """Puts figures of runs between `<!-- headline -->` and `<!-- /headline -->` (`run=publish`).

    Evaluations that are in the table already, and not among the runs, stay in it as long as their
    weights are those that ship.

    Args:
        results: folders of evaluations, one per summary at most, in any order.
        summaries: of kinds of evaluations, by name, in the order of the table; None leaves one out.
        document: that shows them, e.g. README.md.
    """

    def __init__(
        self,
        results: Sequence[str | Path],
        summaries: Mapping[str, Summary | None],
        document: str | Path = "README.md",
    ) -> None:
        self.results, self.document = list(results), Path(document)
        self.summaries = [summary for summary in summaries.values() if summary is not None]

    def run(self) -> dict[str, float]:
        """Writes the table; returns how many runs it shows.

        Raises:
            InputError: a run is missing, damaged, of weights that don't ship, or has no figures; or
                figures that would stay are of other weights.
            StorageError: the document has no place for it, or can't be written.
        """
        before = read_document(self.document, _MARKER)
        runs = read_runs(self.results)
        require_shipped(runs)
        new = {part.summary.name for run in runs for part in parts_in(run, self.summaries)}
        earlier = kept_parts(body(before, _MARKER), self.summaries)
        older_parts = [part for part in earlier if part.summary.name not in new]
        require_known(older_parts, shipped_digests())
        text = headline(runs, self.summaries, older_parts)
        fill(self.document, _MARKER, text)
        print(text)
        return {"runs": float(len(runs))}


def shipped_digests() -> set[str]:
    """SHA-256 of all weights that ship."""
    return {digest(path) for paths in assets.weights().values() for path in paths}


def require_shipped(runs: Sequence[StoredRun]) -> None:
    """Raises an InputError if a run used weights other than the shipped ones."""
    shipped = shipped_digests()
    for run in runs:
        for name, sha256 in run.record.get("weights", {}).items():
            if sha256 not in shipped:
                raise InputError(
                    f"{run.path} has figures of {name}, which are not the shipped weights; "
                    "evaluate the shipped weights"
                )
