"""Batches of simulated stacks, made where a network trains."""
