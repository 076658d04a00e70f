"""From the sets of objects to scene estimates."""
