"""Runs of a sweep side by side."""
