"""Images of scenes of things, simulated and stored, and what trainings make of them."""
