"""Chapter 4: labelled height maps by strategy, network, noise and time."""
