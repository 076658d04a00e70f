"""What tables and figures call the methods of the reconstruction table: a method is one entry."""

from dataclasses import dataclass

BASE_RATE, TRAINING_MEAN = "base_rate", "training_mean"
"""Forecasts of occupancy without an image: the same in every voxel, and one for each."""


@dataclass(frozen=True)
class Method:
    """One method in words; those that are left out follow from its name.

    Args:
        name: in configs and in figures.
        row: of tables of surfaces, volumes and instances.
        samples: row of tables that judge samples as samples.
        figure: what follows the name of a measure where the figure is this method's.
        draws: the same where the figure is of samples judged as samples.
        learns: whether it needs a training.
        reference: it learns nothing, and the others have to be better.
    """

    name: str
    row: str = ""
    samples: str = ""
    figure: str = ""
    draws: str = ""
    learns: bool = True
    reference: bool = False

    def __post_init__(self) -> None:
        plain = self.name.replace("_", " ")
        row = self.row or plain
        defaults = {"row": row, "samples": row, "figure": f", {plain}", "draws": plain}
        for name, words in defaults.items():
            object.__setattr__(self, name, getattr(self, name) or words)


_ENTRIES = (
    Method(
        "drawn_codes",
        "network of volumes, drawn codes (as in the thesis)",
        samples="network of volumes, independent codes, as in the thesis",
        draws="independent codes",
    ),
    Method("network", "network of volumes, zero code, then drawn codes"),
    Method(
        "trained_here",
        "network of volumes, trained in this run",
        samples="independent codes, trained in this run",
    ),
    Method("fully_convolutional", "FC, trained here (no codes)"),
    Method("sscnet", "SSCNet**, trained here (shape alone, its components)"),
    Method("unconditional", "unconditional VAE, trained here (sees no view)"),
    Method(
        "coupled",
        samples="network of volumes, zero code, then coupled codes",
        draws="shipped default (zero code, then coupled codes)",
    ),
    Method(
        "zero_code",
        "network of volumes, zero code",
        samples="network of volumes, zero code alone",
        figure=" of the zero code alone",
    ),
    Method(
        "fitted",
        "network of volumes, zero code, superquadrics fitted to the view",
        samples="zero code, superquadrics fitted",
        figure=" of fitted superquadrics",
        draws="zero code, superquadrics fitted",
    ),
    Method(
        "fitted_hulls",
        "superquadrics fitted to parts of the image (no learning)",
        figure=" of superquadrics fitted to parts",
        draws="superquadrics fitted to parts",
        learns=False,
        reference=True,
    ),
    Method(
        "drawn_fits",
        samples="superquadrics fitted to parts, then drawn (no learning)",
        draws="drawn fits of superquadrics",
        learns=False,
    ),
    Method("conditioned", "all views seen at once, zero code"),
    Method("conditioned_drawn", "all views seen at once, drawn codes (as in the thesis)"),
    Method("optimised", "first view seen, code optimised against all"),
    Method("conditioned_optimised", "all views seen at once, code optimised against them"),
    Method("fitted_views", "all views seen at once, superquadrics fitted to all"),
    Method(
        "fitted_parts",
        "superquadrics fitted to parts of all images (no learning)",
        learns=False,
        reference=True,
    ),
    Method("fusion", "TSDF fusion (no learning)", learns=False),
    Method(
        "set_extents",
        "superquadrics fitted to a network's parts, hidden parts by a flow of sets",
        samples="superquadrics fitted to a network's parts, then drawn by a flow of sets",
        figure=" of fits and a flow of sets",
        draws="drawn by a flow of sets",
    ),
    Method(
        "hidden_objects",
        "superquadrics fitted to a network's parts, hidden parts and objects by flows of sets",
        samples="superquadrics fitted to a network's parts, then drawn with hidden objects",
        draws="drawn by flows of sets, with hidden objects",
    ),
    Method(
        "set_network",
        "a set of objects, each from a code",
        figure=" of a network of sets",
    ),
    Method(
        "crease_parts",
        "superquadrics fitted to parts cut at creases, hidden parts by a flow of sets",
        samples="superquadrics fitted to parts cut at creases, then drawn by a flow of sets",
        figure=" of fits to parts cut at creases and a flow of sets",
        draws="drawn by a flow of sets, parts cut at creases",
    ),
    Method("hull_filling", "hull filling (no learning)", learns=False, reference=True),
    Method(
        "hull",
        "hull of an object's visible points and their footprints, without voxels (no learning)",
        learns=False,
    ),
    Method(
        "mirrored",
        "hull of these and of mirror images of the visible points (no learning)",
        learns=False,
    ),
    Method("partial_tsdf", "partial TSDF meshed (no learning)", learns=False),
    Method("connected_components", "components of the network's shape (no votes)"),
    Method(BASE_RATE, "base rate in every voxel (no image)", learns=False),
    Method(TRAINING_MEAN, "training mean of each voxel (no image)", learns=False),
)
_METHODS = {method.name: method for method in _ENTRIES}

REFERENCES = tuple(method.name for method in _ENTRIES if method.reference)
"""Methods that need no learning and are to be beaten, strongest first."""


def described(name: str) -> Method:
    """A method in words; one that has no entry by its name."""
    return _METHODS.get(name) or Method(name)
