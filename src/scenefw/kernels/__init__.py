"""Per-element functions (one ray, one voxel, one vote), compiled for the CPU and for CUDA."""
