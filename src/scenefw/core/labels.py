"""Where a vertex's label comes from, and which number means that nobody knows."""

NO_SOURCE, FROM_VIEWS, FROM_MAP, FROM_BOTH = 0, 1, 2, 3
"""Values of `HeightMap.sources`."""

UNKNOWN = -1
"""Label of pixels and vertices that count neither in training nor in evaluation."""
