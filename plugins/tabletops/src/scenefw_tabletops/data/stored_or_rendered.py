"""Views and maps of table-tops to train on: kept on disk, or rendered on the training device.

Both ways give the same kinds of samples. A setting chooses between them, as the right one depends
on the machine and on the number of samples: `size.rendered`.
"""

from scenefw.core.errors import ConfigError
from scenefw.core.labelling_protocols import FrameSource
from scenefw_tabletops.data.label_views import RenderedViews, StoredViews
from scenefw_tabletops.data.map_crops import Fused, RenderedMaps, StoredMaps
from scenefw_tabletops.data.table_scenes import TabletopScenes


def views(
    source: FrameSource,
    views: int,
    memory: float = 1500.0,
    renew: int = 1,
    workers: int = -1,
    seed: int = 0,
    *,
    rendered: bool,
) -> RenderedViews | StoredViews:
    """Views of scenes.

    Args:
        source: the scenes.
        views: of each scene.
        memory: megabytes of stored views kept.
        renew: epochs in which a rendered view is used.
        workers: processes that make the scenes of rendered views, -1 = one per core.
        seed: of the cameras of rendered views.
        rendered: from new cameras on the training device, instead of those that the source keeps.

    Raises:
        ConfigError: the source has no scenes to render.
    """
    if rendered:
        return RenderedViews(_scenes(source), views, renew, workers, seed)
    return StoredViews(source, views, memory)


def maps(
    source: FrameSource,
    fused: Fused | None = None,
    workers: int = -1,
    *,
    rendered: bool,
) -> RenderedMaps | StoredMaps:
    """Maps of scenes.

    Args:
        source: the scenes, with their true labels.
        fused: gives the fused map of a scene by its number; None takes the true maps.
        workers: processes that make the scenes of rendered maps, -1 = one per core.
        rendered: true maps, on the training device, instead of those that the source keeps.

    Raises:
        ConfigError: rendered maps would have to be fused, or the source has no scenes to render.
    """
    if rendered and fused is not None:
        raise ConfigError("fused maps are kept on disk; give dataset.train.maps.rendered=false")
    return RenderedMaps(_scenes(source), workers) if rendered else StoredMaps(source, fused)


def _scenes(source: object) -> TabletopScenes:
    if not isinstance(source, TabletopScenes):
        raise ConfigError(
            f"{type(source).__name__} has no scenes to render; give size.rendered=false"
        )
    return source
