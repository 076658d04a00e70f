"""Pages of decompositions into sets of objects (thesis chapter 6)."""
