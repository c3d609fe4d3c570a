"""Self-calibration: what a sequence without truth tells about the half angle, the eye, the camera and the RCM.

Every frame's edge fit leaves the pose and the common quantities free under tight priors; their information, the
priors taken off again, is added up over the frames with the poses eliminated. All axes pass through one RCM, which is
what ties the frames together. A quantity is observable if the sequence makes its sigma at least three
times smaller than its prior's. How much the frames disagree with each other beyond their own sigmas makes all sigmas
larger: one texture misleads every frame, and only the others show by how much.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from conespot.localize.edge.sandwich import EdgeFit
from conespot.localize.image import AnyImage
from conespot.localize.model.knowns import Knowns
from conespot.localize.model.noise import NoiseModel
from conespot.localize.model.solve import inverse, reduction
from conespot.localize.settled_fits import Begun
from conespot.scene.document import InputError
from conespot.scene.pose import tangents
from conespot.scene.scene import Scene

Array = NDArray[np.float64]
#: sigma of what a scene does not have
_FIXED = 1e-9


@dataclass(frozen=True)
class CalibrationSettings:
    """Tuned numbers of the calibration.

    Halved and doubled on five hard frames of one spotlight and five of three, cast as `benchmarks/tuned_numbers.py`
    does: told a half angle 0.05 deg off, three spotlights give it back within 0.0001 deg whatever the number.
    """

    #: how many times smaller than its prior's a sigma must become for a quantity to count as observable: a definition
    observable: float = 3.0
    #: times that frames are fitted around the values found last: with 2 and 6, values change by a hundredth of a sigma
    rounds: int = 3
    #: information below this share of the prior's is none: rounding pulls where a frame says nothing. Halved, nothing
    #: changes; doubled, one spotlight states nearly half the sigma of a half angle that it does not see
    least: float = 1e-2
    #: a frame whose step, squared, is this many times the median's is left out: a vessel or a glint misled it. No
    #: frame here was, halved or doubled
    outlier: float = 30.0
    #: correlation from which on it is said: half of a variance is then another quantity's
    correlated: float = 0.7
    #: how a single frame's fit is held to the common values: it only has to be well conditioned, and comes off again.
    #: Halved or doubled, values change by a hundredth of a sigma
    tight: Knowns = Knowns(  # noqa: RUF009  frozen
        rcm_sigma_mm=0.02,
        half_angle_sigma_deg=0.003,
        softness_sigma=0.01,
        blur_sigma_mm=0.0,
        core_sigma_mm=0.0,
        smear_sigma_mm=0.0,
        eye_radius_sigma_mm=0.01,
        camera_height_sigma_mm=0.03,
        semi_axes_sigma_mm=0.01,
        camera_tilt_sigma_deg=0.05,
    )


CALIBRATION = CalibrationSettings()
QUANTITIES = CALIBRATION.tight.free
NAMES = (*(quantity.name for quantity in QUANTITIES), "rcm_x", "rcm_y", "rcm_z")
#: unit and how many of it are one of that held inside; the RCM's is mm
_UNITS = {quantity.name: (quantity.unit, 1.0 / quantity.per_unit) for quantity in QUANTITIES}


@dataclass(frozen=True)
class Width:
    """Prior sigmas of a calibration: wide, but not so wide that a single frame cannot be fitted."""

    half_angle_deg: float = 0.1
    softness: float = 0.1  #: of a `cycles` beam
    eye_radius_mm: float = 0.3
    camera_height_mm: float = 0.5
    semi_axes_mm: float = 0.0  #: of the retina, told exactly where it is 0
    camera_tilt_deg: float = 0.0  #: towards +x and +y each, told exactly where it is 0
    rcm_mm: float = 0.2
    play_mm: float = 0.005  #: by how much the needle's axis misses the RCM at random

    def sigmas(self, scene: Scene) -> Array:
        """In the order of `NAMES` and the units held inside; a beam without a softness has that of 0, exactly."""
        softness = self.softness if _has_softness(scene) else _FIXED
        own = [np.radians(self.half_angle_deg), softness, self.eye_radius_mm, self.camera_height_mm]
        tilt = np.radians(self.camera_tilt_deg) or _FIXED
        return np.array([*own, *[self.semi_axes_mm or _FIXED] * 3, tilt, tilt, *[self.rcm_mm] * 3])


@dataclass(frozen=True)
class Calibration:
    """What a sequence says about the scene's quantities `NAMES` [rad, 1, mm]."""

    values: Array  #: `[12]`
    covariance: Array  #: `[12, 12]`
    observable: dict[str, bool]
    frames: int  #: that took part
    priors: Array  #: standard deviations `[12]` with which each was asked, about what was told

    @property
    def sigmas(self) -> Array:
        """Standard deviations `[12]` [rad, 1, mm]."""
        return np.sqrt(np.diag(self.covariance))

    def statement(self) -> str:
        """One sentence a quantity: its value and sigma, or that the sequence does not tell."""
        lines = []
        for name, number, sigma, prior in zip(NAMES, self.values, self.sigmas, self.priors, strict=True):
            if sigma <= _FIXED:
                continue
            unit, factor = _UNITS.get(name, ("mm", 1.0))
            said = f"{number * factor:.4f} +- {sigma * factor:.4f} {unit}".rstrip()
            seen = self.observable[name]
            asked = f"{said}, asked with +- {prior * factor:g} {unit}".rstrip()
            lines.append(f"{name}: {said}" if seen else f"{name}: not observable from this sequence ({asked})")
        return "\n".join(lines)

    def correlations(self) -> str:
        """One sentence for each pair of observable quantities that the sequence tells apart only in part."""
        seen = [k for k, name in enumerate(NAMES) if self.observable[name] and self.sigmas[k] > _FIXED]
        among = self.covariance / np.outer(self.sigmas, self.sigmas)
        lines = [
            f"{NAMES[i]} and {NAMES[k]}: correlation {among[i, k]:+.2f}"
            for at, i in enumerate(seen)
            for k in seen[at + 1 :]
            if abs(among[i, k]) >= CALIBRATION.correlated
        ]
        return "\n".join(lines)

    def applied(self, scene: Scene) -> Scene:
        """The scene with the observable quantities replaced by what was found."""
        return _with_values(scene, self.values, [self.observable[name] for name in NAMES])


def calibrate(
    frames: Begun | Callable[[], Iterable[AnyImage]],
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
    begun = frames if isinstance(frames, Begun) else Begun(frames)
    nominal = _values(scene)
    widths = width.sigmas(scene)
    prior = 1.0 / np.square(widths)
    tight = CALIBRATION.tight
    if not _has_softness(scene):
        tight = replace(tight, softness_sigma=0.0)
    if not width.semi_axes_mm:
        tight = replace(tight, semi_axes_sigma_mm=0.0)
    if not width.camera_tilt_deg:
        tight = replace(tight, camera_tilt_sigma_deg=0.0)
    now, found, used = scene, nominal, 0
    covariance = np.diag(1.0 / prior)
    for _ in range(CALIBRATION.rounds):
        here = _values(now)
        fits = begun.settled_fits(now, tight.within(now), noise)
        terms = [_seen(*_term(fit, now, tight, width), widths) for fit in fits]
        if len(terms) < 3:
            raise InputError("calibration needs at least three frames in which the patch can be measured")
        # a frame that a vessel or a glint misled pulls the others: its step is the longest
        pulls = np.array([float(g @ np.linalg.solve(i + np.diag(prior), g)) for i, g in terms])
        terms = [
            t for t, pull in zip(terms, pulls, strict=True) if pull <= CALIBRATION.outlier * np.median(pulls) + 1e-9
        ]
        step, _ = _combined(terms, prior, nominal - here, 1.0)
        step, covariance = _combined(terms, prior, nominal - here, _disagreement(terms, step, widths))
        found, used = here + step, len(terms)
        now = _with_values(scene, found, [True] * len(NAMES))
    ratio = widths / np.sqrt(np.diag(covariance))
    observable = {name: bool(r >= CALIBRATION.observable) for name, r in zip(NAMES, ratio, strict=True)}
    return Calibration(found, covariance, observable, used, widths)


def _has_softness(scene: Scene) -> bool:
    return scene.beam.softness is not None


def _values(scene: Scene) -> Array:
    own = [quantity.read(scene) or 0.0 for quantity in QUANTITIES]
    return np.array([*own, *scene.instrument.rcm])


def _with_values(scene: Scene, values: Array, taken: Sequence[bool]) -> Scene:
    """The scene with those of the values `[12]` that are `taken`."""
    for quantity, new, take in zip(QUANTITIES, values, taken, strict=False):
        if take and quantity.read(scene) is not None:
            scene = quantity.write(scene, float(new))
    own = len(QUANTITIES)
    rcm = tuple(
        float(new) if take else old
        for old, new, take in zip(scene.instrument.rcm, values[own:], taken[own:], strict=True)
    )
    return scene.model_copy(update={"instrument": scene.instrument.model_copy(update={"rcm": rcm})})


def _combined(terms: list[tuple[Array, Array]], prior: Array, off: Array, inflation: float) -> tuple[Array, Array]:
    """The step that all frames and the prior, `off` away, agree on, and its covariance."""
    system = np.diag(prior) + np.sum([i for i, _ in terms], axis=0) / inflation
    right = prior * off + np.sum([g for _, g in terms], axis=0) / inflation
    covariance = inverse(system)
    return covariance @ right, covariance


def _seen(information: Array, pull: Array, widths: Array) -> tuple[Array, Array]:
    """A frame's information and pull without the directions it says next to nothing about."""
    sizes, axes = np.linalg.eigh(information * np.outer(widths, widths))
    kept = axes[:, sizes > CALIBRATION.least]
    part = (kept * sizes[sizes > CALIBRATION.least]) @ kept.T
    return part / np.outer(widths, widths), kept @ (kept.T @ (pull * widths)) / widths


def _disagreement(terms: list[tuple[Array, Array]], step: Array, widths: Array) -> float:
    """How many times larger than by their own sigmas the frames' pulls scatter about `step`, squared; at least 1.

    R. T. Birge, The calculation of errors by the method of least squares, Physical Review 40 (1932).
    """
    total, told = 0.0, 0
    for information, pull in terms:
        sizes, axes = np.linalg.eigh(information * np.outer(widths, widths))
        seen = sizes > CALIBRATION.least / 2.0
        off = (axes.T @ ((pull - information @ step) * widths))[seen]
        total += float(np.sum(np.square(off) / sizes[seen]))
        told += int(np.count_nonzero(seen))
    return max(1.0, total / max(told - len(step), 1))


def _term(fit: EdgeFit, scene: Scene, tight: Knowns, width: Width) -> tuple[Array, Array]:
    """A frame's information on the common quantities and its pull on them, its pose eliminated."""
    estimate = fit.estimate
    size, free = estimate.pose_size, tight.free
    kept = [QUANTITIES.index(quantity) for quantity in free]
    here, nominal = _values(estimate.scene)[kept], _values(scene)[kept]
    own_prior = 1.0 / np.square([tight.sigma(quantity) or np.inf for quantity in free])
    u, v = tangents(estimate.pose.axis)
    offset = np.asarray(scene.instrument.rcm) - estimate.pose.apex
    along = float(offset @ estimate.pose.axis)
    own = size + len(free)
    rows = np.zeros((2, own + 3))
    for k, unit in enumerate((u, v)):
        rows[k, :3], rows[k, 3 + k] = -unit, -along
        rows[k, own:] = unit
    miss = np.array([u @ offset, v @ offset])
    # the frame's own priors come off again; at its minimum the data's slope is theirs turned round
    # light from under the retina is each frame's own, as it falls on another place
    whole = fit.information
    others = reduction(whole, own) if len(whole) > own else np.eye(own)
    data = others @ whole @ others.T
    data[np.arange(size, own), np.arange(size, own)] -= own_prior
    slope = np.concatenate([np.zeros(size), own_prior * (here - nominal)])
    # as tight as it was: a patch that is small is fitted through the RCM itself
    tie = fit.prior[:2, :own]
    data -= tie.T @ tie
    slope += tie.T @ (miss * float(np.linalg.norm(tie[0, :3])))
    # the same slope where the common quantities have the scene's values
    slope += data[:, size:] @ (here - nominal)
    information, pull = np.zeros((own + 3, own + 3)), np.zeros(own + 3)
    information[:own, :own] = data / fit.correlation
    pull[:own] = slope / fit.correlation
    play = rows / width.play_mm
    information += play.T @ play
    pull -= play.T @ (miss / width.play_mm)
    pose, common = information[:size, :size], information[size:, :size]
    solved = np.linalg.solve(pose, np.column_stack([common.T, pull[:size]]))
    # a quantity that is not free here has no information
    at = np.array([*kept, *range(len(QUANTITIES), len(NAMES))])
    told, pulls = np.zeros((len(NAMES), len(NAMES))), np.zeros(len(NAMES))
    told[np.ix_(at, at)] = information[size:, size:] - common @ solved[:, :-1]
    pulls[at] = pull[size:] - common @ solved[:, -1]
    return told, pulls
