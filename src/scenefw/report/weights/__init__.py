"""Documents about weights: cards and the README's table."""
