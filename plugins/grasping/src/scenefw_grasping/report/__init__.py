"""Grasps as tables, pictures and films."""
