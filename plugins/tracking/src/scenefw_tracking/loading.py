"""What `scenefw.load` finds here."""

from scenefw_tracking.tracking import Tracking

LOADERS = {"tracking": Tracking}
