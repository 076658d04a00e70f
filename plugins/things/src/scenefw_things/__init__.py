"""Scenes and images of household things, to train the segmentation on."""
