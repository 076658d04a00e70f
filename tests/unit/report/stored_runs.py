"""Small runs as `run=evaluate` leaves them."""

import json

from scenefw.core.measures import join_measures, write_measures
from scenefw.evaluation.stacks.measures import of_scores
from scenefw_labelling_studies.measures import of_curves, of_networks
from scenefw_single_view_benchmarks.mask_measures import REAL_IMAGES

STACKS = {
    "views": 100.0,
    "scenes": 50.0,
    "samples": 3.0,
    "visibility": 0.41,
    "chamfer_visible": 0.0173,
    "chamfer_visible_floor": 0.0143,
    "chamfer_visible_excess": 0.0030,
    "chamfer_full": 0.0283,
    "chamfer_full_floor": 0.0214,
    "chamfer_full_excess": 0.0067,
    "occupancy_bce": 0.326,
    "instance_iou": 0.733,
    "occupancy_iou": 0.796,
    "zero_code/chamfer_full_excess": 0.0067,
    "zero_code/instance_iou": 0.733,
    "zero_code/occupancy_iou": 0.796,
    "set_extents/chamfer_full_excess": 0.0021,
    "set_extents/instance_iou": 0.822,
    "set_extents/chamfer_full": 0.019,
    "set_extents/occupancy_bce": 0.044,
    "hull_filling/chamfer_full_excess": 0.0148,
    "hull_filling/instance_iou": 0.61,
    "base_rate/occupancy_bce": 0.075,
    "training_mean/occupancy_bce": 0.038,
    "draws/drawn_codes/log_skill": 0.612,
    "draws/drawn_codes/log_skill_low": 0.58,
    "draws/drawn_codes/log_skill_high": 0.64,
    "draws/set_extents/log_skill": 0.92,
    "draws/set_extents/log_skill_low": 0.9,
    "draws/set_extents/log_skill_high": 0.94,
    "draws/hull_filling/log_skill": 0.401,
}
IMAGES = {
    "images": 45.0,
    "overlap_f": 0.9062,
    "boundary_f": 0.8207,
    "objects_f75": 0.85,
    "count_error": 0.244,
    "reference/overlap_f": 0.8733,
    "reference/boundary_f": 0.8127,
    "reference/objects_f75": 0.763,
    "reference/count_error": 0.622,
}
LABELLING = {
    "curves/scenes": 6.0,
    "curves/frames": 200.0,
    "curves/view_based/miou": 0.883,
    "curves/map_based/miou": 0.826,
    "curves/hybrid/miou": 0.882,
    "networks/views/miou": 0.824,
    "networks/views/surface": 0.999,
    "networks/views/number": 240.0,
    "noise/view_based/pose 0 mm, depth 0 mm": 0.8,
}

CLASSES = ("surface", "remote_control", "keyboard", "model_plane")
MEASURES = {
    **of_scores(
        ("drawn_codes", "zero_code", "set_extents", "hull_filling", "base_rate", "training_mean"),
        ("drawn_codes", "set_extents", "hull_filling"),
    ),
    **REAL_IMAGES,
    **join_measures(
        [
            ("curves", of_curves(("view_based", "map_based", "hybrid"))),
            ("networks", of_networks(("views", "maps"), CLASSES)),
        ]
    ),
}


def write_run(folder, figures, weights=None, command=("run=evaluate",)):
    """A folder with metrics.json, measures.json and run.json."""
    folder.mkdir(parents=True)
    write_measures(folder, {name: m for name, m in MEASURES.items() if name in figures})
    (folder / "metrics.json").write_text(json.dumps(figures))
    record = {"seed": 7, "versions": {"commit": "0123456789abcdef"}, "command": list(command)}
    (folder / "run.json").write_text(json.dumps(record | ({"weights": weights} if weights else {})))
    return folder
