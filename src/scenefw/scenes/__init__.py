"""Scenes: generation under physics, storage, cameras."""
