"""Changes to predicted scenes, and what they look like."""
