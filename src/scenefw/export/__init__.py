"""Scene estimates as files: GLB, PLY and a JSON summary."""
