"""Reconstructions as a service over HTTP: a bundled plugin of scenefw."""
