"""Makes the depth image that comes with scenefw, `input=example`, of household things.

python -m benchmarks.example_image
"""

import numpy as np
import torch
from hydra.utils import instantiate

from scenefw import config, plugins
from scenefw.core.assets import example_image
from scenefw.core.geometry import look_at
from scenefw.core.types import Camera
from scenefw.kernels.cameras import stack_cameras

SCENE = 1836  # of `run=generate_things`, seed 0: a part that no training sees
EYE = (0.55, -0.40, 0.50)  # m, from the middle of the things
FOCAL = 560.0  # pixels, of a structured-light camera
WIDTH, HEIGHT = 640, 480


def make() -> None:
    """Writes the image and what it was made of."""
    plugins.activate()
    from scenefw_things.images.renderer import ThingRenderer
    from scenefw_things.scenes.scene import OBJECT

    settings = config.compose(["run=generate_things", "noise=kinect"])
    scene = instantiate(settings.run.source, _convert_="all").generate(SCENE, seed=0)
    things = [item.pose.position for item in scene.items if item.role == OBJECT]
    middle = np.mean(things, axis=0)
    pose = look_at(middle + EYE, middle)
    camera = Camera(WIDTH, HEIGHT, FOCAL, FOCAL, (WIDTH - 1) / 2, (HEIGHT - 1) / 2, pose)
    image = ThingRenderer().images(scene, [camera])[0]
    noise = instantiate(settings.noise.kinect, _convert_="all")
    depth = torch.from_numpy(image.depth.astype(np.float32))[None]
    measured = noise.apply(depth, stack_cameras([camera], "cpu"), torch.tensor([0]))[0].numpy()
    path = example_image()
    np.savez_compressed(
        path,
        depth_mm=np.rint(1000 * measured).astype(np.uint16),
        rgb=image.colour,
        K=camera.matrix.astype(np.float32),
    )
    print(path)


if __name__ == "__main__":
    make()
