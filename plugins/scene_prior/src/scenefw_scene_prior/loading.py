"""What `scenefw.load` finds here."""

from scenefw_scene_prior.sampler import Sampler

LOADERS = {"scenes": Sampler}
