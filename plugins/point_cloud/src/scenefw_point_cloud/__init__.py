"""Point clouds with normals and labels: a plugin of scenefw."""
