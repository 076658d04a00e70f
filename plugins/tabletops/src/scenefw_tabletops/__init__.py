"""Simulated table-tops, and views and maps of them to train labelling networks on."""
