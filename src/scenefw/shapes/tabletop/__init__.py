"""Procedural models of things on tables, one file per family."""
