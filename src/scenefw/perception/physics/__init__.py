"""Bodies of predicted objects, at rest and in contact."""
