"""What documents say of weights: cards and the README's table."""
