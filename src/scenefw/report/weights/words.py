"""What a card says of a kind of network that no file of weights can say."""

from dataclasses import dataclass

from scenefw.core.errors import InputError
from scenefw.learning.checkpoint import SEGMENTATION, SHAPE_INSTANCE
from scenefw.learning.provenance import Provenance
from scenefw.report.weights.measures import IMAGES, LABELLING, MAPS, STACKS, VIEWS, Group

LICENCE = "Apache-2.0, code and weights. All training data are simulated by this project."


@dataclass(frozen=True)
class Words:
    """What the network does, what it is for, where it ends, and which figures sum it up."""

    what: str
    use: tuple[str, ...]
    limits: tuple[str, ...]
    groups: tuple[Group, ...]


_SHAPES = Words(
    "From the partial TSDF of one depth view to the TSDF of all objects, hidden parts included, "
    "and votes for the centres of objects, from which 3D Hough voting makes instances (thesis, "
    "chapter 5; where it leaves the thesis, docs/training.md says how and why).",
    (
        "Complete shapes and separate instances of solid objects on a flat table, from one image "
        "of a depth camera 0.4 to 1.75 m away: `run=predict`.",
        "Comparisons with other methods, and a start for trainings on other data "
        "(`learning.initial`).",
        "Not for decisions on which the safety of people depends: hidden parts are made up.",
    ),
    (
        "Trained on simulated convex solids (superquadrics with edges of 5 to 30 cm) alone. What "
        "is hollow, thin or much smaller comes out filled, in pieces or not at all.",
        "One flat floor, objects within a cube of 1 m, voxels of 1.6 cm: details below some 2 cm "
        "are lost. Colour is not used.",
        "Objects that touch can be taken for one, or one for several.",
        "Its samples should differ where the shape is hidden; how far they do is what the last "
        "row of the first table of figures says.",
    ),
    (STACKS, IMAGES),
)
_LABELS = (
    "Four classes: surface, remote control, keyboard, model plane. Everything else gets the label "
    "of one of them.",
    "Trained on procedural models with drawn textures and light, so real images are another "
    "domain; nothing was measured on them.",
    "Noise of depth and poses costs: docs/results/labelling.md says how much.",
)
_VIEWS = Words(
    "From one colour and depth view of a table to a class per pixel (FuseNet, thesis 4.4), for "
    "view-based and hybrid labelling of height maps.",
    (
        "Labelling of table-tops in the classes below, view by view: `run=label labelling=hybrid`.",
        "Comparisons of labelling strategies: `experiment=labelling`.",
    ),
    _LABELS,
    (VIEWS, LABELLING),
)
_MAPS = Words(
    "From a height map of a table, colour and height, to a class per vertex (FuseNet, thesis 4.4), "
    "for map-based and hybrid labelling.",
    (
        "Labelling of whole height maps in the classes below: `run=label labelling=map_based`.",
        "Comparisons of labelling strategies: `experiment=labelling`.",
    ),
    _LABELS,
    (MAPS, LABELLING),
)


def words_for(provenance: Provenance) -> Words:
    """The words for a network, by its task and input.

    Raises:
        InputError: there are none.
    """
    known = {
        (SHAPE_INSTANCE, None): _SHAPES,
        (SEGMENTATION, "views"): _VIEWS,
        (SEGMENTATION, "maps"): _MAPS,
    }
    key = (provenance.task, provenance.metadata.get("input"))
    if key not in known:
        raise InputError(
            f"{provenance.path} holds a network for {provenance.task} of {key[1]}, of which no "
            "card is known; give weights of shape and instances, or of labels"
        )
    return known[key]
