"""Chapter 5: what results on stacks look like."""
