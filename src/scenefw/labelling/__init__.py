"""Labelling: from many views of a scene to one semantic height map."""
