"""Tables 4.1 and 4.2 of the thesis and the ends of figures 4.23 and 4.24, to print beside ours.

Source: "Scene Understanding for 3D Multi-Object Scenes: Labelling, Reasoning and Decomposing", PhD
thesis, Imperial College London, Department of Computing, chapter 4 (27 test scenes of ShapeNet
models, 1000 frames each, one GPU). The mean IoU of its table 4.1 (0.95 and 0.93) is not the mean
of its own figures per class (0.78 and 0.84), so probably weighted by frequency.
"""

from scenefw.evaluation.statistics import Interval

SOURCE = "thesis"
SCENES = 27
FRAMES = 1000

CLASSES = ("surface", "remote_control", "keyboard", "model_plane")
CLASS_IOU = {"views": (0.99, 0.89, 0.74, 0.51), "maps": (0.99, 0.68, 0.91, 0.78)}
"""Table 4.1: IoU by class on single views and on crops of maps."""
PRINTED_MEAN = {"views": 0.95, "maps": 0.93}
"""Table 4.1: what it calls the mean IoU."""

FINAL = {
    "view_based": Interval(0.889, 0.86, 0.90, SCENES),
    "map_based": Interval(0.922, 0.91, 0.93, SCENES),
}
"""Figures 4.23 and 4.24: mean IoU after 1000 frames with 95 % bounds."""

MILLISECONDS = {
    "data loading": 6.13,
    "reconstruction": 1.78,
    "network, one view": 77.00,
    "semantic fusion": 31.05,
    "network, whole map": 8300.0,
}
"""Table 4.2 (averages per frame, view-based method) and the time to label one map (4.8.4)."""
