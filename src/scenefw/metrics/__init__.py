"""Measures of surfaces, occupancy and instances: pure functions of arrays."""
