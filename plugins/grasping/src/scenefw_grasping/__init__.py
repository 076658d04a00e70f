"""Grasps that disturb the other objects least (thesis 5.5)."""
