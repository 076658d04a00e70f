"""What the figures of decompositions are."""

from scenefw.core.measures import Measure

SCORES = {
    "object_iou": Measure("object IoU", "IoU of objects and their predictions", better="higher"),
    "ari": Measure("ARI", "adjusted Rand index of occupied voxels", better="higher"),
    "missing_or_joined": Measure(
        "missing or joined", "scenes with a missing or joined object", "%", 1, "lower", 100.0
    ),
    "duplicate_or_split": Measure(
        "duplicate or split", "scenes with a duplicated or split object", "%", 1, "lower", 100.0
    ),
    "missing": Measure("missing", "scenes with a missing object", "%", 1, "lower", 100.0),
    "missing_seen": Measure(
        "missing, though seen",
        "scenes with a missing object of which enough is seen",
        "%",
        1,
        "lower",
        100.0,
    ),
    "joined": Measure("joined", "scenes with joined objects", "%", 1, "lower", 100.0),
    "duplicate": Measure("duplicate", "scenes with a duplicated object", "%", 1, "lower", 100.0),
    "split": Measure("split", "scenes with a split object", "%", 1, "lower", 100.0),
    "count_error": Measure("count error", "objects too many or too few", "", 2, "lower"),
    "count_excess": Measure("count excess", "predicted objects - true ones", "", 2),
    "occupancy_iou": Measure("occupancy IoU", "IoU of what is occupied", better="higher"),
    "cross_entropy": Measure("BCE", "binary cross entropy of matched objects", "nats", 4, "lower"),
}
"""Of every method, in the order of columns."""

OTHERS = {
    "hardly_seen": Measure(
        "hardly seen", "scenes with an object of which little is seen", "%", 1, factor=100.0
    ),
    "scenes": Measure("scenes", digits=0),
    "objects": Measure("objects per scene", digits=2),
    "mean_gap": Measure("gap", "channel mean of taken cells - that of all others", digits=3),
    "cells_used": Measure("cells", "different cells that objects are taken from", digits=0),
}
