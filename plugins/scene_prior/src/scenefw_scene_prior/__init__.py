"""Scenes that nobody has seen, and objects that a view hides, drawn by a flow of whole sets."""
