"""scenefw: complete, instance-segmented 3D scenes from views of cluttered table-tops."""
