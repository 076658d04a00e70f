"""Mapping: depth images fused into partial TSDFs."""
