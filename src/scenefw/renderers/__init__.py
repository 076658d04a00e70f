"""Renderers: views of TSDF grids through pinhole cameras."""
