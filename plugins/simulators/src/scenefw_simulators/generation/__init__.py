"""Data sets of scenes that were simulated."""
