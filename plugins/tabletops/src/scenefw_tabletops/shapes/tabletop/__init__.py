"""Procedural models of objects on tables, one file per family."""
