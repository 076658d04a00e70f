"""A small data set file of random, non-physical stacks for tests."""

import numpy as np


def write_stacks(path, scenes=20, seed=0, objects=3):
    rng = np.random.default_rng(seed)
    quaternions = rng.normal(size=(scenes, objects, 4))
    quaternions /= np.linalg.norm(quaternions, axis=-1, keepdims=True)
    split = np.zeros(scenes, np.uint8)
    split[scenes * 7 // 10 :], split[scenes * 17 // 20 :] = 1, 2
    arrays = {
        "half_axes": rng.uniform(0.04, 0.1, (scenes, objects, 3)).astype(np.float32),
        "exponents": rng.uniform(2, 8, (scenes, objects, 3)).astype(np.float32),
        "positions": rng.uniform([-0.2, -0.2, 0.05], [0.2, 0.2, 0.2], (scenes, objects, 3)).astype(
            np.float32
        ),
        "quaternions": quaternions.astype(np.float32),
        "masses": np.ones((scenes, objects), np.float32),
        "count": rng.integers(1, objects + 1, scenes).astype(np.uint8),
        "index": np.arange(scenes, dtype=np.int32) * 2,
        "split": split,
    }
    np.savez(path, **arrays)
    return arrays
