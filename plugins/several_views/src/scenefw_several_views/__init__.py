"""Several views of one scene, and what codes change (thesis 5.3)."""
