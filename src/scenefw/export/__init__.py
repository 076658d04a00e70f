"""Scene estimates as files: meshes, numbers, files for simulators."""
