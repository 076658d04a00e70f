"""Orders hypotheses."""
