"""How good it could be: Cramer-Rao bounds, what every tolerance costs, and what a better design would gain.

Pixel model, stated with every bound: square box pixels that average exactly (`localize.model.forward`), and what else
spreads the image of the scene, its blur's width not known unless somebody says so; Gaussian noise of variance signal +
background noise^2 [e-^2], independent between pixels; the patch's peak at `peak` electrons; uniform albedo, or albedo
known exactly; gain and offset unknown.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from conespot.localize.model.deep import Deep
from conespot.localize.model.estimate import Estimate
from conespot.localize.model.irradiance import Irradiance
from conespot.localize.model.knowns import Knowns
from conespot.localize.model.outline import distances
from conespot.localize.model.prior import prior_rows
from conespot.localize.model.quantity import quantity
from conespot.localize.model.sight import look, window
from conespot.localize.model.solve import inverse
from conespot.localize.model.view import edge_width
from conespot.localize.theory.settings import THEORY
from conespot.scene.pose import Pose
from conespot.scene.scene import Scene
from conespot.scene.surface import Surface

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Electrons:
    """The sensor of a bound: `peak` electrons where the patch is brightest, `background` noise in every pixel [e-]."""

    peak: float = THEORY.peak
    background: float = THEORY.background


@dataclass(frozen=True)
class Bound:
    """What no unbiased estimator can beat on one frame."""

    covariance: Array  #: of the pose `[5, 5]` or `[6, 6]` [mm, rad]

    @property
    def position_mm(self) -> float:
        """Root mean square distance from the true tip [mm]."""
        return float(np.sqrt(np.trace(self.covariance[:3, :3])))

    @property
    def axis_rad(self) -> float:
        """Root mean square angle from the true axis [rad]."""
        return float(np.sqrt(np.trace(self.covariance[3:5, 3:5])))


def patch_pixels(scene: Scene, pose: Pose, margin: float = THEORY.margin_px) -> Array:
    """Centres `[N, 2]` [px] of the frame's pixels around all patches of a pose, `margin` [px] beyond their light."""
    margin += THEORY.widths * edge_width(Estimate(pose, scene))
    points = np.concatenate(_outlines(scene, pose))
    edge = scene.camera.shape[::-1]
    points = points[np.all(np.isfinite(points), axis=1)]
    low = np.clip(np.floor(points.min(axis=0) - margin), 0, edge).astype(int)
    high = np.clip(np.ceil(points.max(axis=0) + margin), 0, edge).astype(int)
    return window(int(low[1]), int(low[0]), int(high[1] - low[1]), int(high[0] - low[0]))


def _outlines(scene: Scene, pose: Pose) -> list[Array]:
    """Every spotlight's outline in the image `[N, 2]` [px]."""
    count = THEORY.outline_points
    return [scene.camera.project(scene.outline(pose, k, count)) for k in range(len(scene.spotlights))]


def cramer_rao(
    scene: Scene,
    pose: Pose,
    sensor: Electrons = Electrons(),
    knowns: Knowns = Knowns(rcm_sigma_mm=None),  # noqa: B008
) -> Bound:
    """The bound for one frame of `scene` at `pose`; with what `knowns` says of RCM, half angle, eye and camera.

    Raises ValueError if the frame does not determine the pose (no patch in it, or nothing to hold a free quantity).
    """
    estimate, knowns = Estimate(pose, scene), knowns.within(scene).doubting
    deep, margin = Deep.of(scene), THEORY.margin_px
    if deep is not None:
        # light that comes back from under the retina is seen as far as it tells of that
        margin = THEORY.glow_reach * deep.kernels[0].reach(0.5) / scene.camera.pixel_pitch
    pixels = patch_pixels(scene, pose, margin)
    sight = look(scene, pixels)
    seen = np.flatnonzero(np.isfinite(sight.points[:, 0]))
    every = np.ones(len(seen), bool)
    light, rows = Irradiance(sight.part(seen), pixels[seen], 1, estimate, knowns, every)(estimate)[0]
    peak = float(np.quantile(light[light > 0.0], THEORY.peak_quantile)) if np.any(light > 0.0) else 0.0
    if peak <= 0.0:
        raise ValueError("the frame shows no patch of this pose")
    gain = sensor.peak / peak
    size, count = estimate.pose_size, len(rows)
    jacobian = np.concatenate([gain * rows, np.stack([gain * light, np.ones(light.size)])])
    information = (jacobian / (gain * light + sensor.background**2)) @ jacobian.T
    _, prior = prior_rows(estimate, scene, knowns)
    information[:count, :count] += prior.T @ prior
    covariance = inverse(information)
    if np.any(np.diag(information) == 0.0) or not np.all(np.isfinite(covariance)):
        raise ValueError("the frame does not determine every free quantity")
    return Bound(covariance[:size, :size])


@dataclass(frozen=True)
class Contribution:
    """What one unit, and one stated tolerance, of a quantity moves the estimate by."""

    quantity: str
    tolerance: float  #: in the unit held inside [mm, rad]
    apex_per_unit: Array  #: `[3]` [mm per mm or rad]
    axis_per_unit: float  #: [rad per mm or rad]

    @property
    def position_mm(self) -> float:
        """Displacement of the tip by one tolerance [mm]."""
        return float(np.linalg.norm(self.apex_per_unit)) * self.tolerance

    @property
    def axis_rad(self) -> float:
        """Turn of the axis by one tolerance [rad]."""
        return self.axis_per_unit * self.tolerance


def error_budget(
    scene: Scene, pose: Pose, *, rcm: bool, tolerances: dict[str, float] | None = None
) -> list[Contribution]:
    """How far a wrong belief in each quantity moves an unbiased outline fit, per unit and for stated tolerances.

    With `rcm` the axis is held on the RCM (three parameters, six with several spotlights less the two it fixes), so
    the RCM's own error passes through; without, the fit is free and the RCM has no part in it.
    """
    found = []
    for name, tolerance in (THEORY.tolerances | (tolerances or {})).items():
        if name.startswith("rcm") and not rcm:
            continue
        step = THEORY.difference
        moves = [_believed(scene, pose, name, sign * step, rcm=rcm) for sign in (1.0, -1.0)]
        derivative = (moves[0] - moves[1]) / (2.0 * step)
        found.append(Contribution(name, tolerance, derivative[:3], float(np.hypot(derivative[3], derivative[4]))))
    return found


def _believed(scene: Scene, pose: Pose, name: str, error: float, *, rcm: bool) -> Array:
    """The step `[5 or 6]` an outline fit takes off the truth when it believes `name` to be larger by `error`."""
    outlines = [
        scene.camera.project(scene.outline(pose, k, THEORY.outline_points)) for k in range(len(scene.spotlights))
    ]
    spots = np.repeat(np.arange(len(outlines)), THEORY.outline_points)
    pixels = np.concatenate(outlines)
    believed = scene
    if name == "focal_length":
        camera = scene.camera.model_copy(update={"focal_length": scene.camera.focal_length + error})
        believed = scene.model_copy(update={"camera": camera})
    elif name.startswith("rcm"):
        # sideways in the plane of tilt, or upwards
        shift = np.array([0.0, 0.0, 1.0]) if name == "rcm_along" else np.array([1.0, 0.0, 0.0])
        moved = tuple(float(c) for c in np.asarray(scene.instrument.rcm) + error * shift)
        believed = scene.model_copy(update={"instrument": scene.instrument.model_copy(update={"rcm": moved})})
    else:
        believed = Estimate(pose, scene).beside(quantity(name), error)
    return _step(pixels, spots, Estimate(pose, believed), rcm=rcm)


def smoothed_over(scene: Scene, pose: Pose, *, rcm: bool) -> Array:
    """The step `[5 or 6]` [mm, rad] an outline fit takes off the truth when it takes the scene's surface for smooth."""
    outlines = [
        scene.camera.project(scene.outline(pose, k, THEORY.outline_points)) for k in range(len(scene.spotlights))
    ]
    smooth = scene.model_copy(update={"surface": Surface()})
    spots = np.repeat(np.arange(len(outlines)), THEORY.outline_points)
    return _step(np.concatenate(outlines), spots, Estimate(pose, smooth), rcm=rcm)


def _step(pixels: Array, spots: NDArray[np.intp], at: Estimate, *, rcm: bool) -> Array:
    r, jac, _ = distances(pixels, spots, at)
    pr, pj = prior_rows(at, at.scene, Knowns(rcm_sigma_mm=0.0 if rcm else None))
    return np.asarray(-np.linalg.solve(jac.T @ jac + pj.T @ pj, jac.T @ r + pj.T @ pr))
