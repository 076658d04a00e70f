"""Noise applied to whole frames: depth as a sensor reads it, poses as tracking estimates them."""

from collections.abc import Mapping
from dataclasses import replace

import torch

from scenefw.core import rng
from scenefw.core.errors import ConfigError
from scenefw.core.made_of import PLAIN, public, settings_of
from scenefw.core.protocols import Noise, PoseNoise
from scenefw.core.types import Frame
from scenefw.kernels.cameras import stack_cameras


def disturb(frame: Frame, noises: Mapping[str, Noise], seed: int, scene: int, index: int) -> Frame:
    """The frame as a noisy sensor with noisy tracking delivers it; itself if there is no noise.

    Each noise draws from its own stream, fixed by (seed, scene, index) and the noise's name:
    another noise beside it, or another amount, leaves its draws as they are.

    Args:
        frame: with true depth and pose.
        noises: by name, applied in the order of the names.
        seed: of the data set.
        scene: number of the scene.
        index: number of the frame in it.
    """
    for name, noise in sorted(noises.items()):
        stream = (scene, index, rng.number_of(name))
        noise_seed = rng.torch_seed(seed, *stream)
        if isinstance(noise, PoseNoise):
            generator = torch.Generator().manual_seed(noise_seed)
            frame = replace(frame, camera=noise.move(frame.camera, generator))
            continue
        depth = torch.from_numpy(frame.depth.copy())[None]
        noisy = noise.apply(depth, stack_cameras([frame.camera]), torch.tensor([noise_seed]))
        frame = replace(frame, depth=noisy[0].numpy())
    return frame


def depth_noises(noises: Mapping[str, Noise] | None, views: str) -> dict[str, Noise]:
    """The noises of depth images, in the order in which they are applied: that of the names.

    Args:
        noises: by name; None: none.
        views: what they disturb, whose poses are exact, for the message.

    Raises:
        ConfigError: noise of poses, which would do nothing.
    """
    moving = [
        name for name, noise_model in (noises or {}).items() if isinstance(noise_model, PoseNoise)
    ]
    if moving:
        raise ConfigError(f"{views} have exact poses; leave out the pose noise {', '.join(moving)}")
    return dict(sorted((noises or {}).items()))


def described(noises: Mapping[str, Noise]) -> list[str]:
    """Each noise with its amounts in words, e.g. `gaussian sigma=0.002 lowest=0.002 share=1`."""
    return [
        " ".join([name, *(f"{n}={_short(v)}" for n, v in public(noise).items())])
        for name, noise in sorted(noises.items())
    ]


def _short(value: object) -> str:
    if isinstance(value, float):
        return f"{value:.4g}"
    return str(value if isinstance(value, (*PLAIN, tuple)) else settings_of(value))
