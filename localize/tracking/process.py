"""How a hand-held needle moves, as the tracker believes: a model of its own, which knows nothing of who moves it.

Along each coordinate the tip is where a steady velocity takes it, disturbed by white acceleration of density q, and
beside that a damped oscillator: the hand's physiological tremor (C. N. Riviere, P. S. Jensen, A study of instrument
motion in retinal microsurgery, Proc. IEEE EMBS 22, 2000). It is driven by another of its kind, that by a third, and
that by white noise: with r = 2 pi f its spectral density is c / ((r^2 - w^2)^2 + (2 d r w)^2)^3, c so that its root
mean square is as stated. One oscillator alone has so much beyond its band that frames hardly help each other.

By how much the axis misses the line from the remote centre of motion is a first-order Gauss-Markov process about zero.
Discretized by C. F. Van Loan, Computing integrals involving the matrix exponential, IEEE Trans. Automatic Control 23,
1978.
"""

from __future__ import annotations

import functools
import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import expm, solve_continuous_lyapunov

from conespot.localize.model.knowns import Knowns
from conespot.localize.outcome import Localization
from conespot.scene.pose import Pose, tangents
from conespot.scene.scene import Scene

Array = NDArray[np.float64]
_CHAIN = 3  #: oscillators, each of which drives the one before
_OF = (
    2 + 2 * _CHAIN
)  # states of a coordinate: position, velocity; tremor and its rate; what drives it, and its rate; ...
SIZE, SEEN = 3 * _OF + 2, 5  # of the state, and of what a frame tells of it


@dataclass(frozen=True)
class ProcessSettings:
    """What the tracker believes of hands, chosen from the literature and by spectra, on no frame."""

    #: spectral density of the acceleration [mm^2/s^3]: 5 mm/s^2 for 0.1 s at a time
    acceleration: float = 3.0
    #: root mean square of the tremor along a coordinate [mm], its frequency [Hz] and damping: 0.18 mm in all three
    #: coordinates. The wider the band, the less frames help each other; this one takes less than a hundredth of a sigma
    #: of 2 to 4 um off a tremor that fills 8 to 10 Hz evenly, by the spectra
    tremor_mm: float = 0.105
    tremor_hz: float = 9.0
    damping: float = 0.12
    #: how long the axis goes on missing the RCM as it does [s], and by how much where the RCM is not known [rad]
    miss_s: float = 1.0
    miss_rad: float = 0.3
    #: velocity that a new track may have [mm/s]
    first_mm_s: float = 10.0


PROCESS = ProcessSettings()
_PARTS = tuple(slice(_OF * c, _OF * c + _OF) for c in range(3))  # of the state, a coordinate each
#: what a frame sees of the state: position and tremor together, and the axis' miss
OBSERVED = np.zeros((SEEN, SIZE))
for _c in range(3):
    OBSERVED[_c, [_OF * _c, _OF * _c + 2]] = 1.0
RATES = np.zeros((3, SIZE))
RATES[:, 1:] = OBSERVED[:3, :-1]  # each is followed by its rate
OBSERVED[3, 3 * _OF] = OBSERVED[4, 3 * _OF + 1] = 1.0


@dataclass(frozen=True, eq=False)
class Belief:
    """Mean `[26]` and covariance `[26, 26]` of the state: eight of each coordinate, and the misses along U and V."""

    mean: Array
    covariance: Array

    @classmethod
    def first(cls, seen: Array, noise: Array, miss: float) -> Belief:
        """What one frame says `[5]`, with covariance `[5, 5]`; nothing is known of velocities."""
        mean, vague = np.zeros(SIZE), np.diag([miss**2] * SIZE)
        mean[: 3 * _OF : _OF] = seen[:3]
        for part in _PARTS:
            vague[part, part] = np.diag([1.0, PROCESS.first_mm_s**2, *[0.0] * (2 * _CHAIN)])
            vague[part, part][2:, 2:] = _tremor()[1]
        return cls(mean, vague).corrected(seen, noise)

    def moved(self, seconds: float, miss: float) -> Belief:
        """After some time."""
        change, added = transition(round(seconds, 9), miss)
        return Belief(change @ self.mean, change @ self.covariance @ change.T + added)

    def corrected(self, seen: Array, noise: Array) -> Belief:
        """With what a frame says, in Joseph's form."""
        gain = np.linalg.solve(self._innovation(noise), OBSERVED @ self.covariance).T
        rest = np.eye(SIZE) - gain @ OBSERVED
        return Belief(
            self.mean + gain @ (seen - OBSERVED @ self.mean),
            rest @ self.covariance @ rest.T + gain @ noise @ gain.T,
        )

    def surprise(self, seen: Array, noise: Array) -> float:
        """Squared innovation of what a frame says over its covariance: chi-squared of five degrees if all holds."""
        off = seen - OBSERVED @ self.mean
        return float(off @ np.linalg.solve(self._innovation(noise), off))

    def _innovation(self, noise: Array) -> Array:
        return np.asarray(OBSERVED @ self.covariance @ OBSERVED.T + noise)

    def way(self, exposure_s: float) -> Array:
        """Covariance of the tip's places during an exposure `[3, 3]` [mm^2], tremor and all.

        A velocity that is known in part is less in the mean than the needle's: what is not known of it counts as well.
        """
        velocity = RATES @ self.mean
        square = np.outer(velocity, velocity) + RATES @ self.covariance @ RATES.T
        return np.asarray(square * exposure_s**2 / 12.0)

    def pose(self, scene: Scene) -> Pose:
        """The pose that is believed."""
        tip, miss = OBSERVED[:3] @ self.mean, self.mean[3 * _OF :]
        line = Pose.through(tip, scene.instrument.rcm).axis
        u, v = tangents(line)
        axis = line + miss[0] * u + miss[1] * v
        return Pose(tip, axis / np.linalg.norm(axis))

    def pose_covariance(self, scene: Scene) -> Array:
        """Covariance `[5, 5]` over tip [mm] and axis along U and V [rad], as a `Localization` states it."""
        back = np.linalg.inv(_towards_miss(self.pose(scene), scene))
        return np.asarray(back @ OBSERVED @ self.covariance @ OBSERVED.T @ back.T)


def seen_of(found: Localization, scene: Scene) -> tuple[Array, Array]:
    """What an answer says of the state `[5]`, and with which covariance `[5, 5]`: the tip, and the axis' miss."""
    assert found.covariance is not None
    line = Pose.through(found.apex_mm, scene.instrument.rcm).axis
    u, v = tangents(line)
    matrix = _towards_miss(Pose(found.apex_mm, found.axis), scene)
    seen = np.array([*found.apex_mm, u @ found.axis, v @ found.axis])
    return seen, np.asarray(matrix @ found.covariance[:5, :5] @ matrix.T)


def _towards_miss(pose: Pose, scene: Scene) -> Array:
    """From small changes of tip and axis to those of tip and miss `[5, 5]`: the line turns as the tip moves."""
    u, v = tangents(pose.axis)
    length = float(np.linalg.norm(pose.apex - np.asarray(scene.instrument.rcm)))
    matrix = np.eye(5)
    matrix[3, :3], matrix[4, :3] = -u / length, -v / length
    return matrix


def miss_of(knowns: Knowns, scene: Scene) -> float:
    """Standard deviation of the axis' miss [rad]: how well the RCM is known, over a needle of the eye's radius."""
    sigma = knowns.rcm_sigma_mm
    return PROCESS.miss_rad if sigma is None else max(sigma / scene.eye.radius, 1e-6)


@functools.cache
def _tremor() -> tuple[Array, Array, float]:
    """The oscillators' drift `[6, 6]`, their stationary covariance `[6, 6]`, and the density of what drives them."""
    rate = 2.0 * math.pi * PROCESS.tremor_hz
    drift, white = np.zeros((2 * _CHAIN, 2 * _CHAIN)), np.zeros((2 * _CHAIN, 2 * _CHAIN))
    for k in range(0, 2 * _CHAIN, 2):
        drift[k, k + 1] = 1.0
        drift[k + 1, k : k + 2] = -(rate**2), -2.0 * PROCESS.damping * rate
        drift[k + 1, k + 2 : k + 3] = rate**2
    white[-1, -1] = 1.0
    unit = solve_continuous_lyapunov(drift, -white)
    density = PROCESS.tremor_mm**2 / float(unit[0, 0])
    return drift, np.asarray(density * unit), density


@functools.lru_cache(maxsize=64)
def transition(seconds: float, miss: float) -> tuple[Array, Array]:
    """Transition `[26, 26]` over a time, and the covariance that is added."""
    tremor, _, density = _tremor()
    drift = np.zeros((_OF, _OF))
    drift[0, 1] = 1.0
    drift[2:, 2:] = tremor
    noise = np.diag([0.0, PROCESS.acceleration, *[0.0] * (2 * _CHAIN - 1), density])
    whole = expm(np.block([[-drift, noise], [np.zeros_like(drift), drift.T]]) * seconds)
    step = whole[_OF:, _OF:].T
    change, added = np.zeros((SIZE, SIZE)), np.zeros((SIZE, SIZE))
    for part in _PARTS:
        change[part, part], added[part, part] = step, step @ whole[:_OF, _OF:]
    keeps = math.exp(-seconds / PROCESS.miss_s)
    for c in range(3 * _OF, SIZE):
        change[c, c], added[c, c] = keeps, miss**2 * (1.0 - keeps**2)
    return change, (added + added.T) / 2.0
