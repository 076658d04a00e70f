"""Recordings for the viewer Rerun: a bundled plugin of scenefw."""
