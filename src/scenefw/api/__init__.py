"""scenefw from Python: `scenefw.load` and what it gives."""
