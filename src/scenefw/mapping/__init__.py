"""Mapping: views fused into partial TSDFs, height maps and labels; odometry."""
