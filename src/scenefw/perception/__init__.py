"""From a real depth image to a scene estimate: floor, checks, reconstruction."""
