"""Rigid-body simulators behind the Engine protocol, one file each."""
