"""One scene from several views, or from a mesh."""
