"""What a depth image says: floor, workspace, points, noise, free space."""
