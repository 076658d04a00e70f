"""Rigid geometry in float64: quaternions (w, x, y, z), poses as 4x4 matrices, look-at cameras."""

import numpy as np
from numpy.typing import ArrayLike, NDArray

Array = NDArray[np.float64]


def rotation_from_quaternion(quaternion: ArrayLike) -> Array:
    """Rotation matrices (..., 3, 3) of quaternions (..., 4) in the order (w, x, y, z)."""
    q = np.asarray(quaternion, dtype=np.float64)
    q = q / np.linalg.norm(q, axis=-1, keepdims=True)
    w, x, y, z = np.moveaxis(q, -1, 0)
    entries = [
        1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y),
        2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x),
        2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y),
    ]  # fmt: skip
    return np.stack(entries, axis=-1).reshape(*q.shape[:-1], 3, 3)


def quaternion_from_rotation(rotation: ArrayLike) -> Array:
    """Unit quaternion (4,) with w >= 0 of one rotation matrix (3, 3) (Bar-Itzhack 2000)."""
    m = np.asarray(rotation, dtype=np.float64)
    xx, yx, zx, xy, yy, zy, xz, yz, zz = m.T.ravel()
    k = np.array(
        [
            [xx - yy - zz, 0, 0, 0],
            [yx + xy, yy - xx - zz, 0, 0],
            [zx + xz, zy + yz, zz - xx - yy, 0],
            [zy - yz, xz - zx, yx - xy, xx + yy + zz],
        ]
    )
    values, vectors = np.linalg.eigh(k / 3.0, UPLO="L")
    x, y, z, w = vectors[:, np.argmax(values)]
    q = np.array([w, x, y, z])
    return q if w >= 0 else -q


def random_quaternion(rng: np.random.Generator) -> Array:
    """A uniformly distributed unit quaternion with w >= 0."""
    q = rng.normal(size=4)
    q /= np.linalg.norm(q)
    return q if q[0] >= 0 else -q


def rigid(rotation: ArrayLike, translation: ArrayLike) -> Array:
    """The 4x4 matrix of a rotation (3, 3) and a translation (3,)."""
    matrix = np.eye(4)
    matrix[:3, :3] = rotation
    matrix[:3, 3] = translation
    return matrix


def inverse(transform: ArrayLike) -> Array:
    """The inverse of a rigid 4x4 matrix."""
    t = np.asarray(transform, dtype=np.float64)
    return rigid(t[:3, :3].T, -t[:3, :3].T @ t[:3, 3])


def transform_points(transform: ArrayLike, points: ArrayLike) -> Array:
    """Points (..., 3) moved by a 4x4 matrix."""
    t = np.asarray(transform, dtype=np.float64)
    array = np.asarray(points, dtype=np.float64)
    # For points of a whole image BLAS takes twice as long, and ten times beside other processes
    transformed: Array = np.einsum("...j,ij->...i", array, t[:3, :3]) + t[:3, 3]
    return transformed


def bounds(points: Array) -> tuple[Array, Array]:
    """Lowest and highest corner (3,) of points (N, 3); ten times faster than `min(axis=0)`."""
    columns = points.T
    return np.array([c.min() for c in columns]), np.array([c.max() for c in columns])


def within(points: Array, low: ArrayLike, high: ArrayLike) -> NDArray[np.bool_]:
    """Whether each point (..., K) lies between two corners (K,) or on them; NaN doesn't."""
    inside = np.ones(points.shape[:-1], dtype=bool)
    for axis, (lowest, highest) in enumerate(zip(np.asarray(low), np.asarray(high), strict=True)):
        inside &= (points[..., axis] >= lowest) & (points[..., axis] <= highest)
    return inside


def look_at(eye: ArrayLike, target: ArrayLike, up: ArrayLike = (0.0, 0.0, 1.0)) -> Array:
    """`T_world_camera` (..., 4, 4) of cameras at `eye` (..., 3) looking at `target` (..., 3).

    The camera frame is x right, y down, z forward.
    """
    eye = np.asarray(eye, dtype=np.float64)
    forward = np.asarray(target, dtype=np.float64) - eye
    forward /= np.linalg.norm(forward, axis=-1, keepdims=True)
    right = np.cross(forward, np.asarray(up, dtype=np.float64))
    length = np.linalg.norm(right, axis=-1, keepdims=True)
    # looking along `up`: any right will do
    right = np.where(length < 1e-9, np.cross(forward, (0.0, 1.0, 0.0)), right)
    right /= np.linalg.norm(right, axis=-1, keepdims=True)
    pose = np.zeros((*forward.shape[:-1], 4, 4))
    pose[..., :3, :3] = np.stack([right, np.cross(forward, right), forward], axis=-1)
    pose[..., :3, 3] = eye
    pose[..., 3, 3] = 1
    return pose
