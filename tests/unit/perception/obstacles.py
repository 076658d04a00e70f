"""The obstacles of the settings that ship."""

from scenefw.perception.observation.geometric_obstacles import GeometricObstacles

OBSTACLES = GeometricObstacles(max_size=0.45, max_height=0.4, wall_distance=0.015, min_pixels=60)
