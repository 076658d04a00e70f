"""What `scenefw.load` finds here."""

from scenefw_decomposing.decomposer import Decomposer

LOADERS = {"decomposing": Decomposer}
