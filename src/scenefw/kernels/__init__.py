"""Per-element functions (one ray, one voxel, one vote), compiled once for the CPU and once for CUDA."""
