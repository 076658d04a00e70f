"""Shapes: superquadrics and the library that stacks are made of."""
