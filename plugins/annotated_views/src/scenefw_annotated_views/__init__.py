"""Views of scenes with masks, poses and visibility, for other programs."""
