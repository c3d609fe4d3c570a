"""Self-calibration: what a sequence without truth tells about the half angle, the eye, the camera and the RCM.

Every frame's edge fit leaves the pose and the common quantities free under tight priors; their information, the
priors taken off again, is added up over the frames with the poses eliminated. All axes pass through one RCM, which is
what ties the frames together. A quantity is observable if the sequence makes its sigma at least three
times smaller than its prior's.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from localize.band import BandFit
from localize.edge import fit_edge
from localize.forward import tangents
from localize.noise import NoiseModel, noise_of
from localize.prior import FREE, Knowns, value
from localize.start import find_start
from scene.document import InputError
from scene.eye import Eye
from scene.scene import Scene

Array = NDArray[np.float64]
NAMES = ("half_angle", "eye_radius", "camera_height", "rcm_x", "rcm_y", "rcm_z")
_OBSERVABLE = 3.0
_ROUNDS = 3
_OUTLIER = 30.0
#: how a single frame's fit is held to the common values: it only has to be well conditioned
_TIGHT = Knowns(0.02, 0.003, 0.01, 0.03)


@dataclass(frozen=True)
class Width:
    """Prior sigmas of a calibration: wide, but not so wide that a single frame cannot be fitted."""

    half_angle_deg: float = 0.1
    eye_radius_mm: float = 0.3
    camera_height_mm: float = 0.5
    rcm_mm: float = 0.2
    play_mm: float = 0.005  #: by how much the needle's axis misses the RCM at random

    def sigmas(self) -> Array:
        """In the order of `NAMES` and the units held inside."""
        return np.array(
            [np.radians(self.half_angle_deg), self.eye_radius_mm, self.camera_height_mm, *[self.rcm_mm] * 3]
        )


@dataclass(frozen=True)
class Calibration:
    """What a sequence says about the scene's quantities `NAMES` [rad, mm]."""

    values: Array  #: `[6]`
    covariance: Array  #: `[6, 6]`
    observable: dict[str, bool]
    frames: int  #: that took part

    @property
    def sigmas(self) -> Array:
        """Standard deviations `[6]` [rad, mm]."""
        return np.sqrt(np.diag(self.covariance))

    def statement(self) -> str:
        """One sentence a quantity: its value and sigma, or that the sequence does not tell."""
        lines = []
        for name, number, sigma in zip(NAMES, self.values, self.sigmas, strict=True):
            factor, unit = (180.0 / np.pi, "deg") if name == "half_angle" else (1.0, "mm")
            said = f"{number * factor:.4f} +- {sigma * factor:.4f} {unit}"
            lines.append(
                f"{name}: {said}" if self.observable[name] else f"{name}: not observable from this sequence ({said})"
            )
        return "\n".join(lines)

    def applied(self, scene: Scene) -> Scene:
        """The scene with the observable quantities replaced by what was found."""
        found = dict(zip(NAMES, self.values, strict=True))
        update: dict[str, object] = {}
        if self.observable["half_angle"] and "half_angle" in type(scene.beam).model_fields:
            update["beam"] = scene.beam.model_copy(update={"half_angle": float(found["half_angle"])})
        if self.observable["eye_radius"]:
            update["eye"] = Eye(radius=float(found["eye_radius"]))
        if self.observable["camera_height"]:
            update["camera"] = scene.camera.model_copy(update={"height": float(found["camera_height"])})
        old = scene.instrument.rcm
        rcm = tuple(
            float(found[f"rcm_{c}"]) if self.observable[f"rcm_{c}"] else old[i] for i, c in enumerate(("x", "y", "z"))
        )
        update["instrument"] = scene.instrument.model_copy(update={"rcm": rcm})
        return scene.model_copy(update=update)


def calibrate(
    frames: Callable[[], Iterable[NDArray[np.generic]]],
    scene: Scene,
    *,
    width: Width = Width(),
    noise: NoiseModel | None = None,
) -> Calibration:
    """Calibrate from checked frames of one instrument in one eye, none of them with a known pose.

    `frames` is called once a round and gives the same frames each time. Each round fits them around the values found
    last, held so tightly that all frames' equations belong to one point: otherwise the size of the whole scene, which
    no image tells, would seem to be known. Raises InputError if fewer than three frames can be fitted.
    """
    sensor = noise or noise_of(scene)
    nominal = _values(scene)
    prior = 1.0 / np.square(width.sigmas())
    now, found, used = scene, nominal, 0
    covariance = np.diag(1.0 / prior)
    for _ in range(_ROUNDS):
        here = _values(now)
        terms = []
        for image in frames():
            start = find_start(image, now)
            fit = start if isinstance(start, str) else fit_edge(image, now, start, _TIGHT, sensor)
            if not isinstance(fit, str) and fit.settled:
                terms.append(_term(fit, now, width, 6 if len(scene.spotlights) > 1 else 5))
        if len(terms) < 3:
            raise InputError("calibration needs at least three frames in which the patch can be measured")
        # a frame that a vessel or a glint misled pulls the others: its step is the longest
        pulls = np.array([float(g @ np.linalg.solve(i + np.diag(prior), g)) for i, g in terms])
        terms = [t for t, pull in zip(terms, pulls, strict=True) if pull <= _OUTLIER * np.median(pulls) + 1e-9]
        system = np.diag(prior) + np.sum([i for i, _ in terms], axis=0)
        right = prior * (nominal - here) + np.sum([g for _, g in terms], axis=0)
        scale = np.sqrt(np.diag(system))
        covariance = np.linalg.inv(system / np.outer(scale, scale)) / np.outer(scale, scale)
        found, used = here + covariance @ right, len(terms)
        now = _with_values(scene, found)
    ratio = width.sigmas() / np.sqrt(np.diag(covariance))
    observable = {name: bool(r >= _OBSERVABLE) for name, r in zip(NAMES, ratio, strict=True)}
    return Calibration(found, covariance, observable, used)


def _values(scene: Scene) -> Array:
    return np.array([*[value(scene, name) for name in FREE], *scene.instrument.rcm])


def _with_values(scene: Scene, values: Array) -> Scene:
    names = ("half_angle",) if "half_angle" in type(scene.beam).model_fields else ()
    return Calibration(values, np.eye(6), {name: name in names or name != "half_angle" for name in NAMES}, 0).applied(
        scene
    )


def _term(fit: BandFit, scene: Scene, width: Width, size: int) -> tuple[Array, Array]:
    """A frame's information on the six common quantities and its pull on them, its pose eliminated."""
    estimate = fit.estimate
    here = np.array([estimate.half_angle, estimate.scene.eye.radius, estimate.scene.camera.height])
    nominal = _values(scene)[:3]
    own_prior = 1.0 / np.square([_TIGHT.sigma(name) or np.inf for name in FREE])
    u, v = tangents(estimate.pose.axis)
    offset = np.asarray(scene.instrument.rcm) - estimate.pose.apex
    along = float(offset @ estimate.pose.axis)
    rows = np.zeros((2, size + 6))
    for k, unit in enumerate((u, v)):
        rows[k, :3], rows[k, 3 + k] = -unit, -along
        rows[k, size + 3 :] = unit
    miss = np.array([u @ offset, v @ offset])
    # the frame's own priors come off again; at its minimum the data's slope is theirs turned round
    data = fit.information.copy()
    data[np.arange(size, size + 3), np.arange(size, size + 3)] -= own_prior
    slope = np.concatenate([np.zeros(size), own_prior * (here - nominal)])
    assert _TIGHT.rcm_sigma_mm is not None
    tie = rows[:, : size + 3] / _TIGHT.rcm_sigma_mm
    data -= tie.T @ tie
    slope += tie.T @ (miss / _TIGHT.rcm_sigma_mm)
    # the same slope where the common quantities have the scene's values
    slope += data[:, size:] @ (here - nominal)
    information, pull = np.zeros((size + 6, size + 6)), np.zeros(size + 6)
    information[: size + 3, : size + 3] = data / fit.correlation
    pull[: size + 3] = slope / fit.correlation
    play = rows / width.play_mm
    information += play.T @ play
    pull -= play.T @ (miss / width.play_mm)
    pose, common = information[:size, :size], information[size:, :size]
    solved = np.linalg.solve(pose, np.column_stack([common.T, pull[:size]]))
    return information[size:, size:] - common @ solved[:, :-1], pull[size:] - common @ solved[:, -1]
