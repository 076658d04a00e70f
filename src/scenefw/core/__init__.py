"""Frozen types, protocols, geometry, randomness, files and errors: numpy only."""
