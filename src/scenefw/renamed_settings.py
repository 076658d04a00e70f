"""Names that options and settings had before: who types them is told what to type instead."""

from __future__ import annotations

from collections.abc import Mapping

OPTIONS: Mapping[str, str] = {
    "reconstructor=set_flow": "reconstructor=set_extents",
    "reconstructor=hidden_objects": "completion=hidden_objects",
    "reconstructor=by_evidence": "reconstructor=fitted",
    "reconstructor=part_guided": "reconstructor=fitted",
    "dataset=seen_sets": "dataset=set_flow",
    "evaluation=drawn_sets": "evaluation=draws",
    "evaluation=set_extents": "evaluation=draws",
    "evaluation=decomposition": "evaluation=object_sets",
    "evaluation=confidence": "experiment=confidence",
    "evaluation=mesh_stacks": "experiment=mesh_stacks",
    "evaluation=osd": "experiment=osd",
    "evaluation=ranking": "experiment=ranking",
    "evaluation=real_images": "experiment=real_images",
    "evaluation=stability": "experiment=stability",
    "evaluation=table_5_1": "experiment=table_5_1",
    "evaluation=visible_masks": "experiment=visible_masks",
    "evaluation=hybrid_weights": "experiment=hybrid_weights",
    "evaluation=labelling": "experiment=labelling",
    "evaluation=set_prior": "experiment=set_prior",
    "evaluation=latent_space": "experiment=latent_space",
    "evaluation=several_views": "experiment=several_views",
    "evaluation=grasping": "experiment=grasping",
    "completion=learned_shapes": "shells=network",
    "parts=affinity": "segmentation=affinity",
    "parts=creases": "segmentation=creases",
}
"""What was typed, and what is typed now."""

_EXTRACTOR = "reconstructor.completion.extractor"
_BEST = "reconstructor=set_extents, which is better"
_COLOURS = "nothing: the network sees the colours, and their edges said no more"
_FITS = "evaluation=draws, which has the methods that are better"
_ALONE = "nothing: there is no other, and its settings are typed as grid.extent=2 is"
_FIXED = "nothing: other values were no better"
_FLOOR = "segmentation.floor_margin; the floor's noise adds three standard deviations"
_LOW = "tolerances.floor_margin, where the floor's errors don't reach higher"
_GROUPED = "nothing: with the network that ships, pixels stay with their segments"
_BASINS = "segmentation.min_basin_depth, higher for fewer regions"
_MERGED = "segmentation.merging.intercept, higher for fewer segments"
_SMOOTHED = "nothing: images are smoothed by a pixel of one 640 wide"
_SWITCHES = "the settings that it changed, as model.zero_share=0 (docs/training.md#sweeps)"
DELETED: Mapping[str, str] = {
    "paths=default": _ALONE,
    "grid=default": _ALONE,
    "report=page": _ALONE,
    "heights=height_fusion": _ALONE,
    "odometry=rgbd": _ALONE,
    "matching=assignment": _ALONE,
    "augmentation=default": _ALONE,
    "viewpoints=random": _ALONE,
    "edges=stereo": _ALONE,
    "hollow=vessels": _ALONE,
    "observer=depth_image": _ALONE,
    "observer=posed_images": "run=decompose, which observes with it",
    "augmentation=none": "augmentation.rotation=0 augmentation.shift=0",
    "viewpoints=near": "viewpoints.heights=[0.33,0.83] viewpoints.closest=0.5",
    "gallery=none": "gallery=null",
    "gallery=stacks": "evaluation=reconstruction, which shows them",
    "semantics=semantic_fusion": _ALONE,
    "semantics=image_space_fusion": "labelling=image_space",
    "map_label_source=network": "label_source@map_label_source=network_of_maps",
    "map_label_source=by_height": "label_source@map_label_source=by_height",
    "map_label_source=by_rule": "label_source@map_label_source=by_rule",
    "map_label_source=by_rule_easy": "label_source@map_label_source=by_rule_easy",
    "logger": "logger.NAME=null to leave one out, +logger.NAME._target_=CLASS to add one",
    "callback": "callback.NAME=null to leave one out, +callback.NAME._target_=CLASS to add one",
    "showcase=none": "nothing: experiment=simstack alone shows its data",
    "showcase=stacks": "experiment=simstack, which shows its data",
    "dataset=few": "dataset=stacks dataset.path=few_v2",
    "dataset=large_stacks": "dataset=stacks dataset.path=large_stacks_v2",
    "dataset=scattered": "dataset=stacks dataset.path=scattered_v2",
    "dataset=stacks_of_six": "dataset=stacks dataset.path=stacks_of_six_v2",
    "dataset=wide": "dataset=stacks dataset.path=wide_v2",
    "dataset=stacks_and_scattered": "dataset=stacks 'dataset.path=[stacks_v2,scattered_v2]'",
    "dataset=object_sets_of_six": "dataset=object_sets dataset.path=stacks_of_six_v2",
    "dataset=tabletop_views_rendered": "dataset=tabletop_views size.rendered=true size.renew=1",
    "dataset=tabletop_maps_rendered": "dataset=tabletop_maps size.rendered=true",
    "scene=few": "scene=stacks scene.minimum=1 scene.maximum=2",
    "scene=large_stacks": "scene=stacks scene.minimum=4 scene.maximum=8",
    "scene=stacks_of_six": "scene=stacks scene.minimum=6 scene.maximum=6",
    "scene=stacks_of_seven": "scene=stacks scene.minimum=7 scene.maximum=7",
    "scene=scattered_wide": "experiment=wide_scenes, which makes and scores them",
    "model=fusenet_deep": (
        "model=fusenet 'model.widths=[16,24,48,80,112]' 'model.modules=[1,2,2,3,2]'"
    ),
    "experiment=object_queries": "experiment=set_extents, which is better",
    "experiment=image_queries": "experiment=set_extents, which is better",
    "reconstructor=object_queries": _BEST,
    "completion=object_queries": "completion=set_extents, which is better",
    "model=object_queries": "model=set_extents, which is better",
    "model=image_queries": "model=set_extents, which is better",
    "learning=object_queries": "learning=set_flow, with model=set_extents",
    "dataset=object_queries": "dataset=set_extents",
    "dataset=image_queries": "dataset=set_extents",
    "dataset=viewed_sets": "dataset=set_extents",
    "dataset=imaged_sets": "dataset=set_extents",
    "evaluation=object_queries": _FITS,
    "evaluation=queried_sets": _FITS,
    "evaluation=set_predictors": _FITS,
    "checkpoints.object_queries": _BEST,
    "checkpoints.image_queries": _BEST,
    "checkpoints.queries": _BEST,
    "dataset=scattered_v1": "dataset=stacks_v1 dataset.path=scattered_v1",
    "dataset=stacks_and_scattered_v1": "dataset=stacks_v1 'dataset.path=[stacks_v1,scattered_v1]'",
    "segmentation.floor_sigmas": _FLOOR,
    "segmentation.min_height": _LOW,
    "segmentation.min_height_sigmas": _LOW,
    "segmentation.lowest": _LOW,
    "segmentation.noisy": _LOW,
    "tolerances.min_height": _LOW,
    "reconstructor.lowest": _LOW,
    "observer.workspace.least_height": _LOW,
    "observer.workspace.min_height": _LOW,
    "hollow.min_height": "hollow.min_depth",
    "segmentation.waves": _FLOOR,
    "segmentation.colours": _COLOURS,
    "segmentation.colours.neutral": _COLOURS,
    "segmentation.colours.reach": _COLOURS,
    "segmentation.colours.smoothing": _COLOURS,
    "segmentation.colours.weight": _COLOURS,
    "segmentation.min_core_affinity": _BASINS,
    "segmentation.min_region": _BASINS,
    "segmentation.sure": _BASINS,
    "segmentation.seed": _BASINS,
    "segmentation.min_affinity": _MERGED,
    "segmentation.same": _MERGED,
    "segmentation.min_crease_affinity": _MERGED,
    "segmentation.agreed": _MERGED,
    "edges.colour.smoothing": _SMOOTHED,
    "grouping.reassign": _GROUPED,
    "grouping.min_divided": _GROUPED,
    "settling.rank": "ranking=stability",
    "grouping.reach": "nothing: it is two voxels",
    "observer.workspace.margin": "nothing: objects stay a voxel from the sides of the cube",
    "run=headline": "run=publish, with run.results=[FOLDER,...]",
    "run=pictures": "run=publish, with input=FOLDER",
    "experiment=simstack_ablation": f"-m and {_SWITCHES}",
    "experiment=decomposition_ablation": f"-m, experiment=table_6_2 and {_SWITCHES}",
    "ablation=fully_convolutional": "experiment=thesis/fully_convolutional",
    "ablation=sscnet": "experiment=thesis/sscnet",
    "ablation=unconditional": "experiment=thesis/unconditional",
    "ablation=thesis_codes": "experiment=thesis/simstack",
    "ablation=adamw": "optimizer=adamw",
    "ablation=wide": "size.network=wide",
    "ablation=with_scattered": "'dataset.path=[stacks_v2,scattered_v2]'",
    "ablation": _SWITCHES,
    "postprocessing": f"postprocessing@{_EXTRACTOR}=..., of a network of volumes",
    "fit.outliers": _FIXED,
    "fit.single.outliers": _FIXED,
    "fit.resolution": _FIXED,
    "grouping.split.min_ratio": "grouping.split.min_pixels",
    "reconstructor.least": _FIXED,
    "reconstructor.fit.min_points": _FIXED,
    "hollow.min_inside_ratio": "hollow.min_gain",
    "hollow.max_free_ratio": "tolerances.max_free_ratio, of other shapes",
    "edges.min_step": _FIXED,
    "edges.colour.core_ratio": _FIXED,
    "segmentation.min_object_probability": "segmentation.min_pixel_probability",
    "segmentation.shown": "segmentation.min_pixel_probability",
    "obstacles.min_enclosed_ratio": "obstacles.max_size, over which rims are looked at",
}
"""What is gone, and what does the same or better."""

KEYS: Mapping[str, str] = {
    **{
        f"postprocessing.{name}": f"{_EXTRACTOR}.{name}"
        for name in ("threshold", "subdivisions", "gamma", "bandwidth", "merging", "smallest")
    },
    "grouping.merge.fits.evidence": "evidence",
    "reconstructor.fit.evidence": "evidence",
    "evidence.visible_points": "evidence.surface_points",
    "evidence.hidden_points": "evidence.surface_points",
    "checkpoints.sets": "checkpoints.set_extents",
    "checkpoints.parts": "checkpoints.part_affinity",
    "checkpoints.scenes": "checkpoints.set_flow",
    "parts": "segmentation",
    "segmentation.pixel": "segmentation.min_pixel_probability",
    "segmentation.margin": "segmentation.floor_margin",
    "segmentation.smallest": "segmentation.min_pixels",
    "segmentation.crease_segmentation": "segmentation.merging.creases",
    "segmentation.plain": "segmentation.merging.creases",
    "parts.plain": "segmentation.merging.creases",
    "segmentation.jump": "segmentation.max_step",
    "segmentation.crease": "segmentation.min_bend",
    "floor.threshold": "floor.inlier_distance",
    "floor.farthest": "floor.max_depth",
    "floor.least_share": "floor.min_inlier_ratio",
    "ranking.sigma": "tolerances.point_sigma",
    "ranking.near": "tolerances.inlier_distance",
    "ranking.inlier_distance": "tolerances.inlier_distance",
    "ranking.furthest": "ranking.max_displacement",
    "observer.doctor.nearest": "observer.doctor.min_distance",
    "observer.doctor.farthest": "observer.doctor.max_distance",
    "observer.doctor.smallest": "observer.doctor.min_size",
    "observer.doctor.least_measured": "observer.doctor.min_measured_ratio",
    "observer.doctor.flattest": "observer.doctor.min_tilt",
    "observer.doctor.aligned": "observer.doctor.min_alignment",
    "run.pipeline.table": "run.pipeline.observer.table",
    "run.pipeline.views": "run.max_views",
    "several_views@run.pipeline.reconstructor": "several_views@run.pipeline",
    "reconstructor.smallest": "completion.min_volume",
    "reconstructor.suppress": "completion.max_iou",
    "parts.pixel": "segmentation.min_pixel_probability",
    "parts.margin": "segmentation.floor_margin",
    "parts.smallest": "segmentation.min_pixels",
    "fit.inner": "fit.single",
    "run.pipeline.reconstructor": "reconstructor",
    "run.pipeline.samples": "reconstructor.samples",
    "run.pipeline.seed": "seed",
    "run.pipeline.carve": "reconstructor.assembly.carve",
    "run.pipeline.ranking": "ranking",
    "run.pipeline.workspace": "observer.workspace",
    "run.pipeline.doctor": "observer.doctor",
    "run.pipeline.floor": "floor",
    "run.pipeline.mapping": "mapping",
    "reconstructor.inner.inner.grid": "reconstructor.grid",
    "reconstructor.inner.parts": "segmentation",
    "reconstructor.inner.grouping": "grouping",
    "reconstructor.checkpoint": "reconstructor.completion.checkpoint",
    "reconstructor.temperature": "reconstructor.completion.temperature",
    "reconstructor.smoothing": "reconstructor.completion.smoothing",
    "reconstructor.votes": "completion.median_of",
    "reconstructor.steps": "completion.steps",
    "reconstructor.spread": "completion.spread",
    "reconstructor.drawn_sigma": "completion.pseudo_sigma",
    "reconstructor.beyond": "completion.min_gap",
    "reconstructor.hidden": "completion.hidden",
    "reconstructor.drawn": "reconstructor.completion.drawn",
    "reconstructor.vessels": "hollow",
    "reconstructor.calibration": "reconstructor.assembly.calibration",
    "reconstructor.near": "tolerances.inlier_distance",
    "reconstructor.explained": "tolerances.min_inlier_ratio",
    "evaluation.methods.scenefw": "evaluation.methods.set_network",
    "evaluation.parts.of_six.methods.scenefw": "evaluation.parts.of_six.methods.set_network",
    "evaluation.parts.of_four_to_eight.methods.scenefw": (
        "evaluation.parts.of_four_to_eight.methods.set_network"
    ),
    "evaluation.parts.superquadrics.methods.scenefw": (
        "evaluation.parts.superquadrics.methods.drawn_codes"
    ),
    "evaluation.parts.ycb.methods.scenefw": "evaluation.parts.ycb.methods.drawn_codes",
    "evaluation.parts.meshes.methods.scenefw": "evaluation.parts.meshes.methods.drawn_codes",
    "evaluation.parts.stacks.methods.scenefw": "evaluation.parts.stacks.methods.network",
    "evaluation.parts.noisy.methods.scenefw": "evaluation.parts.noisy.methods.network",
    "evaluation.parts.scattered.methods.scenefw": "evaluation.parts.scattered.methods.network",
    "evaluation.methods.set_flow": "evaluation.methods.set_extents",
    "evaluation.reference.margin": "evaluation.reference.floor_margin",
    "evaluation.reference.smallest": "evaluation.reference.min_pixels",
    "evaluation.reference.jump": "evaluation.reference.max_step",
    "evaluation.reference.crease": "evaluation.reference.min_bend",
}
"""Beginnings of keys, and what they begin with now."""


VIEWS: Mapping[str, str] = {
    "run.pipeline.doctor": "run.pipeline.observer.doctor",
    "run.pipeline.workspace": "run.pipeline.observer.workspace",
    "run.pipeline.table": "run.pipeline.observer.table",
    "run.pipeline.floor": "run.pipeline.observer.table",
    "run.pipeline.mapping": "mapping",
    "run.pipeline.views": "run.max_views",
}
"""The same for `run=decompose`, whose pipeline has an observer of its own."""

_PIPELINE = "run.pipeline."


def instead_of(key: str, value: str) -> str | None:
    """What to give instead of an option or a setting that was deleted; None if it wasn't.

    Args:
        key: without `+` and `~`.
        value: behind the `=`.
    """
    return DELETED.get(f"{key}={value}", DELETED.get(key))


def new_name(key: str, value: str, *, views: bool = False) -> str | None:
    """What to type instead of a setting that was renamed; None if it wasn't.

    Args:
        key: without `+` and `~`.
        value: behind the `=`.
        views: whether the run is `run=decompose`.
    """
    if f"{key}={value}" in OPTIONS:
        return OPTIONS[f"{key}={value}"]
    new, newer = key, _renamed(key, views)
    while newer is not None:  # renamed more than once, each part of a key by itself
        new, newer = newer, _renamed(newer, views)
    return None if new == key else new


def _renamed(key: str, views: bool) -> str | None:
    """A key after one renaming; None if there is none."""
    if not views or not key.startswith("run."):
        return _replaced(key, KEYS)
    renamed = _replaced(key, VIEWS)
    if renamed is None and key.startswith(f"{_PIPELINE}observer."):
        inner = _replaced(key.removeprefix(_PIPELINE), KEYS)
        renamed = None if inner is None else f"{_PIPELINE}{inner}"
    return renamed


def _replaced(key: str, names: Mapping[str, str]) -> str | None:
    for old in sorted(names, key=len, reverse=True):
        if key == old or key.startswith((f"{old}.", f"{old}@")):
            return f"{names[old]}{key[len(old) :]}"
    return None
