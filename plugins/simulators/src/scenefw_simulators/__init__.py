"""Predicted scenes for simulators and robots: MuJoCo, PyBullet, USD, MoveIt."""
