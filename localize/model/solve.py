"""Least squares: normal equations, how far a step may go, and Gauss-Newton with Levenberg's damping."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from conespot.localize.model.estimate import Estimate
from conespot.localize.model.quantity import Quantity
from conespot.localize.model.residual import student_cost, student_weights

Array = NDArray[np.float64]


@dataclass(frozen=True)
class StepSettings:
    """Tuned numbers of every fit's steps; by `benchmarks/tuned_numbers.py step` no answer changes at half or double."""

    #: a last step longer than this, in sigmas of the fit, means that the fit does not settle: by definition one sigma
    settled_sigmas: float = 1.0
    #: largest turn of the axis along U or V in one step [rad]: what a start may be off by, and within which the outline
    #: is nearly linear in it
    longest_turn: float = 0.05


STEP = StepSettings()


def limited(step: Array, longest_mm: float) -> Array:
    """A step, shorter where it moves the tip by more than `longest_mm` along a coordinate or turns the axis too far."""
    tip, axis = float(np.max(np.abs(step[:3]))), float(np.max(np.abs(step[3:5])))
    return np.asarray(step / max(1.0, tip / longest_mm, axis / STEP.longest_turn))


def reduction(information: Array, size: int) -> Array:
    """The rows `[size, P]` that take the last parameters out of normal equations `[P, P]`."""
    return np.concatenate(
        [np.eye(size), -np.linalg.solve(information[size:, size:], information[size:, :size]).T], axis=1
    )


def solved(information: Array, gradient: Array) -> Array | None:
    """The solution of normal equations, well scaled; None if they have none."""
    scale = np.sqrt(np.maximum(np.diag(information), 1e-300))
    try:
        step: Array = np.linalg.solve(information / np.outer(scale, scale), gradient / scale) / scale
    except np.linalg.LinAlgError:
        return None
    return step if np.all(np.isfinite(step)) else None


def inverse(information: Array) -> Array:
    """The inverse of an information matrix, well scaled; infinite where it has none."""
    scale = np.sqrt(np.maximum(np.diag(information), 1e-300))
    try:
        return np.asarray(np.linalg.inv(information / np.outer(scale, scale)) / np.outer(scale, scale))
    except np.linalg.LinAlgError:
        return np.full_like(information, np.inf)


@dataclass(frozen=True)
class Solution:
    """A minimum: the estimate, the information matrix there and the whitened residuals of the data."""

    estimate: Estimate
    information: Array  #: `[P, P]`, priors included
    residuals: Array  #: `[N]`
    converged: bool


#: whitened residuals `[N]`, Jacobian `[N, P]`, prior residuals `[Q]` and rows `[Q, P]` at an estimate
Problem = Callable[[Estimate], tuple[Array, Array, Array, Array]]


def minimize(
    problem: Problem,
    start: Estimate,
    free: tuple[Quantity, ...],
    *,
    robust: bool = True,
    iterations: int = 30,
    tolerance: float = 1e-9,
) -> Solution | None:
    """The estimate that minimizes the (Student-t) cost; None when the problem is singular."""
    estimate, damping, pose_size = start, 1e-6, start.pose_size
    r, jac, pr, pj = problem(estimate)
    cost = _cost(r, pr, robust)
    converged = False
    for _ in range(iterations):
        if len(r) + len(pr) < 5 or not np.isfinite(cost):
            return None
        w = student_weights(r) if robust else np.ones_like(r)
        information = (jac * w[:, None]).T @ jac + pj.T @ pj
        gradient = (jac * w[:, None]).T @ r + pj.T @ pr
        size = np.sqrt(np.maximum(np.diag(information), 1e-300))
        scaled = information / np.outer(size, size)
        for _ in range(8):
            try:
                step = -np.linalg.solve(scaled + damping * np.eye(len(size)), gradient / size) / size
            except np.linalg.LinAlgError:
                return None
            if not np.all(np.isfinite(step)) or float(np.linalg.norm(step[3:pose_size])) > 1.0:
                damping = max(damping * 10.0, 1e-3)
                continue
            trial = estimate.moved(step, free)
            new = problem(trial)
            new_cost = _cost(new[0], new[2], robust)
            if new_cost <= cost * (1.0 + 1e-12) + 1e-300:
                break
            damping = max(damping * 10.0, 1e-3)
        else:
            return Solution(estimate, information, r, True)
        small = float(np.max(np.abs(step[:pose_size]))) < tolerance
        estimate, (r, jac, pr, pj), cost = trial, new, new_cost
        damping = max(damping / 10.0, 1e-15)
        if small:
            converged = True
            break
    w = student_weights(r) if robust else np.ones_like(r)
    information = (jac * w[:, None]).T @ jac + pj.T @ pj
    return Solution(estimate, information, r, converged)


def _cost(r: Array, pr: Array, robust: bool) -> float:
    return (student_cost(r) if robust else float(np.sum(np.square(r)))) + float(np.sum(np.square(pr)))
