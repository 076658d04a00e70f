"""Measures of trainings."""

from scenefw.core.measures import Measure

TRAINING = {
    "train/steps": Measure("steps", digits=0),
    "train/seconds": Measure("training", "time of training", "s", digits=0),
    "train/parameters": Measure("parameters", unit="million", digits=1, factor=1e-6),
}
