"""What `scenefw.load` finds here."""

from scenefw_editing.scene import Scene

LOADERS = {"scene": Scene}
