"""Chapter 5: shape and instances of stacks, simulated ones and real images labelled by hand."""
