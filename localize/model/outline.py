"""The exact outline of a cone on the eye's wall: five parameters (six for a rig) from edge points, no ellipse."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from conespot.localize.model.estimate import Estimate
from conespot.localize.model.forward import cross, rotation_basis
from conespot.localize.model.knowns import Knowns
from conespot.localize.model.prior import prior_rows
from conespot.localize.model.sight import Sight, look
from conespot.localize.model.solve import Problem, Solution, minimize
from conespot.scene.pose import Pose
from conespot.scene.scene import Scene
from conespot.scene.spotlights import spotlight_axes

Array = NDArray[np.float64]
#: an outline is smoother than light: differences of it may be this much finer
_FINER = 0.1


def distances(pixels: Array, spots: NDArray[np.intp], estimate: Estimate) -> tuple[Array, Array, Array]:
    """Distances `[N]` [px] of pixels `[N, 2]` from the outlines of their `spots` `[N]`, positive outside.

    Also their derivatives by the pose `[N, 5 or 6]` and by the half angle `[N]`. The distance is the residual angle
    off the cone over that angle's gradient across the image: exact on the outline and to first order beside it.
    """
    off = Off.of(look(estimate.scene, pixels), spots, estimate)
    pose = estimate.pose
    each = spotlight_axes(pose, estimate.scene.spotlights)
    basis = rotation_basis(pose.axis)[: estimate.pose_size - 3]
    turns = [
        -np.einsum("ij,ij->i", off.to, np.stack([cross(vector, axis) for axis in each])[spots]) / off.sine
        for vector in basis
    ]
    jacobian = np.column_stack([-off.across, *turns]) / off.slope[:, None]
    return off.distance, jacobian, -1.0 / off.slope


@dataclass(frozen=True, eq=False)
class Off:
    """How far off the cones of their spots N pixels are."""

    distance: Array  #: from the outline `[N]` [pixels of the sight], positive outside
    to: Array  #: unit vectors from the tip to what they see `[N, 3]`
    sine: Array  #: of the angle off the axis `[N]`
    across: Array  #: gradient of that angle over what they see `[N, 3]` [1/mm]
    slope: Array  #: and over the image `[N]` [1/pixel]

    @classmethod
    def of(cls, sight: Sight, spots: NDArray[np.intp], estimate: Estimate) -> Off:
        """From what the pixels see, whose outlines are those of their `spots` `[N]`."""
        axes = spotlight_axes(estimate.pose, estimate.scene.spotlights)[spots]
        to = sight.points - estimate.pose.apex
        d = np.linalg.norm(to, axis=1)
        to = to / d[:, None]
        c = np.einsum("ij,ij->i", to, axes)
        aside = axes - c[:, None] * to
        s = np.maximum(np.linalg.norm(aside, axis=1), 1e-12)
        # the arc tangent keeps full precision where the arc cosine loses half the digits
        residual = np.arctan2(s, c) - estimate.scene.beam.half_angle
        across = -aside / (d * s)[:, None]
        gx, gy = (np.einsum("ij,ij->i", across, along) for along in (sight.along_x, sight.along_y))
        slope = np.hypot(gx, gy)
        return cls(residual / slope, to, s, across, slope)


def outline_problem(
    pixels: Array, spots: NDArray[np.intp], sigma: Array | float, scene: Scene, knowns: Knowns
) -> Problem:
    """The least-squares problem of edge points `[N, 2]` [px] with standard deviations `sigma` [px] across the edge."""
    weight = 1.0 / np.broadcast_to(np.asarray(sigma, float), (len(pixels),))

    def problem(estimate: Estimate) -> tuple[Array, Array, Array, Array]:
        r, jac, by_angle = distances(pixels, spots, estimate)
        columns = [jac]
        for quantity in knowns.free:
            if quantity.changes != "sight":
                columns.append(by_angle[:, None] * quantity.widens)
                continue
            step = _FINER * quantity.step
            sides = [
                distances(pixels, spots, Estimate(estimate.pose, estimate.beside(quantity, s)))[0]
                for s in (step, -step)
            ]
            columns.append(((sides[0] - sides[1]) / (2.0 * step))[:, None])
        pr, pj = prior_rows(estimate, scene, knowns)
        return r * weight, np.hstack(columns) * weight[:, None], pr, pj

    return problem


def fit_outline(
    pixels: Array,
    scene: Scene,
    *,
    spots: NDArray[np.intp] | None = None,
    sigma: Array | float = 1.0,
    knowns: Knowns = Knowns(),  # noqa: B008  frozen
    start: Pose | None = None,
    robust: bool = True,
) -> Solution | None:
    """The pose whose cones meet the scene's surface in an outline through `pixels` `[N, 2]` [px].

    `spots` `[N]` names the spotlight of each point (all 0 if not given), `sigma` [px] the error across it. Without a
    `start` the cone whose axis passes through the RCM is fitted first: three parameters have no second solution.
    None if there are fewer points than parameters or the fit is singular.
    """
    points = np.asarray(pixels, float)
    which = np.zeros(len(points), np.intp) if spots is None else spots
    pose = start if start is not None else start_pose(points, which, scene)
    if pose is None or len(points) < 6:
        return None
    first = Estimate(pose, scene)
    if start is None:
        exact = Knowns(rcm_sigma_mm=1e-3)
        tied = minimize(outline_problem(points, which, 1.0, scene, exact), first, (), robust=robust)
        if tied is None:
            return None
        first = tied.estimate
    problem = outline_problem(points, which, sigma, scene, knowns)
    return minimize(problem, first, knowns.free, robust=robust, tolerance=1e-11)


def start_pose(pixels: Array, spots: NDArray[np.intp], scene: Scene) -> Pose | None:
    """The pose through the RCM whose cone is about as wide as the points `[N, 2]` [px] where it meets the surface."""
    points = look(scene, pixels).points
    points = points[np.all(np.isfinite(points), axis=1)]
    if len(points) < 3:
        return None
    centre = points.mean(axis=0)
    rcm = np.asarray(scene.instrument.rcm)
    towards = (centre - rcm) / np.linalg.norm(centre - rcm)
    beta = scene.beam.half_angle
    # the widest spotlight's reach off the needle's axis
    down = np.array([0.0, 0.0, -1.0])
    offsets = spotlight_axes(Pose(np.zeros(3), down), scene.spotlights)
    reach = beta if len(offsets) == 1 else beta + float(np.mean(np.arccos(np.clip(offsets @ down, -1.0, 1.0))))
    off = points - centre
    off = off - (off @ towards)[:, None] * towards
    # one outline lies on a ring; of several only the outermost points tell the reach
    width = np.linalg.norm(off, axis=1)
    radius = float(np.mean(width) if len(offsets) == 1 else np.quantile(width, 0.9))
    distance = min(radius / np.tan(reach), 0.95 * float(np.linalg.norm(centre - rcm)))
    return Pose.through(centre - distance * towards, rcm)
