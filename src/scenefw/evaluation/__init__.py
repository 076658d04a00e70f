"""Protocols: one file per table or figure, over named methods."""
