"""Household things by formula: trees of convex parts in metres, drawn from named ranges."""
