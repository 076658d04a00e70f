"""Shapes fitted to what views say about objects."""
