"""A pose as other programs state it: metres, unit quaternions, covariance over translation and rotation vector.

The needle's frame has its origin at the tip and z along the axis into the light. A cone looks the same however it is
turned about its axis, so where no roll is known x lies in the vertical plane through the axis (U of
`scene.pose.tangents`), and the covariance says that this means nothing: pi^2 / 3, the variance of an angle of which
nothing is known. The camera's is ROS's optical frame (REP 103): x right, y down in the image, z forward.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from conespot.localize.outcome import Localization
from conespot.scene.camera import Camera
from conespot.scene.pose import Pose, tangents

Array = NDArray[np.float64]
METRES = 1e-3  # a millimetre
#: variance of an angle that may be anything [rad^2]
FREE_ROLL = math.pi**2 / 3.0


def needle_rotation(found: Localization) -> Array:
    """Rotation `[3, 3]` whose columns are the needle's x, y and z in the eye."""
    return np.asarray(Pose(found.apex_mm, found.axis, found.roll or 0.0).rotation() @ np.diag([1.0, -1.0, -1.0]))


def camera_rotation(camera: Camera) -> Array:
    """Rotation `[3, 3]` whose columns are the optical frame's x, y and z in the eye."""
    right, up, back = camera.axes
    return np.stack([right, -up, -back], axis=1)


def quaternion(rotation: Array) -> tuple[float, float, float, float]:
    """The unit quaternion (x, y, z, w), w not negative, of a rotation `[3, 3]`; S. W. Shepperd, J. Guidance 1, 1978.

    >>> quaternion(np.eye(3))
    (0.0, 0.0, 0.0, 1.0)
    """
    r, trace = rotation, float(np.trace(rotation))
    largest = int(np.argmax([*np.diag(r), trace]))
    if largest == 3:
        q = np.array([r[2, 1] - r[1, 2], r[0, 2] - r[2, 0], r[1, 0] - r[0, 1], 1.0 + trace])
    else:
        i, j, k = largest, (largest + 1) % 3, (largest + 2) % 3
        q = np.empty(4)
        q[i] = 1.0 + r[i, i] - r[j, j] - r[k, k]
        q[j], q[k], q[3] = r[j, i] + r[i, j], r[k, i] + r[i, k], r[k, j] - r[j, k]
    q /= np.linalg.norm(q) * (-1.0 if q[3] < 0.0 else 1.0)
    return float(q[0]), float(q[1]), float(q[2]), float(q[3])


def pose_covariance(found: Localization) -> Array | None:
    """Covariance `[6, 6]` over x, y, z [m] and rotations about the eye's x, y, z [rad]; None where none is stated."""
    if found.covariance is None:
        return None
    u, v = tangents(found.axis)
    stated = np.zeros((6, 6))
    size = len(found.covariance)
    stated[:size, :size] = found.covariance
    if size == 5:
        stated[5, 5] = FREE_ROLL
    jacobian = np.zeros((6, 6))
    jacobian[:3, :3] = METRES * np.eye(3)
    # rotation vectors that move the axis along U and V; a pose's roll turns about the needle's back end
    jacobian[3:, 3:] = np.stack([-v, u, -np.asarray(found.axis)], axis=1)
    return np.asarray(jacobian @ stated @ jacobian.T)
