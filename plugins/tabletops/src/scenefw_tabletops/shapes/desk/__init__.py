"""Procedural models of cluttered desks: nine classes whose sizes and colours overlap, and more."""
