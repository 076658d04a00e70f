"""Noise: disturbs depth images like a sensor."""
