"""Volumes that describe a scene on a voxel grid: signed distance, occupancy, centre votes."""
