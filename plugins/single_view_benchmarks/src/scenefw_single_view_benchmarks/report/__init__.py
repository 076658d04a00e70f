"""Sections of their pages."""
