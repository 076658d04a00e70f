"""Decomposing scenes into sets of objects (thesis chapter 6)."""
