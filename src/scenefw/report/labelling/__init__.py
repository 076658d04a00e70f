"""Chapter 4: what labelled height maps look like."""
