"""Noise: depth images disturbed as a sensor does."""
