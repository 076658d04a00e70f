"""Predictions and maps in the browser: a bundled plugin of scenefw."""
