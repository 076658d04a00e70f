"""Timings of scenefw beside other libraries: `python -m benchmarks`."""
