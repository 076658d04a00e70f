"""True labels of a height map, painted by hand on its picture."""
