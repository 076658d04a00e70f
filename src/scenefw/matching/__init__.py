"""Which prediction belongs to which truth: costs and assignments."""
