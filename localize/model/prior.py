"""What is known beside the image as rows of a least-squares problem: the RCM and the scene's quantities.

A quantity with sigma 0 is fixed, with sigma None free, else it has a Gaussian prior around the scene's value. All
but the RCM join the parameters of a fit; the RCM acts on the pose through the distance by which the axis misses it.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from conespot.localize.model.estimate import Estimate
from conespot.localize.model.knowns import Knowns
from conespot.scene.pose import Pose, tangents
from conespot.scene.scene import Scene

Array = NDArray[np.float64]
#: an "exactly" known RCM: far below anything an image can tell, yet well conditioned
_EXACT_MM = 1e-6


def rcm_miss(pose: Pose, scene: Scene) -> Array:
    """By how much the axis misses the RCM, along U and V `[2]` [mm]."""
    u, v = tangents(pose.axis)
    offset = np.asarray(scene.instrument.rcm) - pose.apex
    return np.array([u @ offset, v @ offset])


def on_rcm(rows: Array, pose: Pose, scene: Scene) -> Array:
    """Derivatives by the tip `[3, N]` of what has `rows` `[5 or more, N]` by tip and axis, the axis held on the RCM."""
    u, v = tangents(pose.axis)
    length = float(np.linalg.norm(pose.apex - np.asarray(scene.instrument.rcm)))
    return np.asarray(rows[:3] + (np.outer(u, rows[3]) + np.outer(v, rows[4])) / length)


def prior_rows(estimate: Estimate, nominal: Scene, knowns: Knowns) -> tuple[Array, Array]:
    """Whitened residuals `[Q]` and Jacobian `[Q, P]` of what is known, for P = pose parameters and free quantities."""
    free, pose_size = knowns.free, estimate.pose_size
    size = pose_size + len(free)
    residuals: list[float] = []
    rows: list[Array] = []
    if knowns.rcm_sigma_mm is not None:
        sigma = max(knowns.rcm_sigma_mm, _EXACT_MM)
        u, v = tangents(estimate.pose.axis)
        along = float((np.asarray(nominal.instrument.rcm) - estimate.pose.apex) @ estimate.pose.axis)
        for k, unit in enumerate((u, v)):
            row = np.zeros(size)
            row[:3] = -unit
            row[3 + k] = -along
            rows.append(row / sigma)
        residuals.extend(rcm_miss(estimate.pose, nominal) / sigma)
    for j, quantity in enumerate(free):
        spread = knowns.sigma(quantity)
        if spread is not None:
            row = np.zeros(size)
            row[pose_size + j] = 1.0 / spread
            rows.append(row)
            residuals.append((quantity.value(estimate.scene) - quantity.value(nominal)) / spread)
    return np.array(residuals).reshape(-1), np.array(rows).reshape(-1, size)
