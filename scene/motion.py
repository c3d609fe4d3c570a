"""Motion: how the instrument moves while a frame is exposed. Its pose at mid-exposure is the true one.

The tip moves, and the axis goes on passing through the RCM; about the axis the instrument does not turn.
"""

from __future__ import annotations

import functools
import math
from dataclasses import replace
from typing import Annotated, Any, Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray
from pydantic import BeforeValidator, Field, model_validator

from conespot.scene.model import Model, Words
from conespot.scene.pose import Pose
from conespot.scene.quantity import Hertz, Length, Seconds, Speed, format_quantity
from conespot.scene.sensor import AnySensor

Array = NDArray[np.float64]

#: of a tremor's band [1/s]: of one narrower the size stands still for a second and longer, and is not the one stated
NARROWEST = 1.0
#: sinusoids that a tremor is made of, along each axis
_WAVES = 64
#: instants by which a tremor's way is known: at least, and in the period of its fastest wave. Straight lines between
#: them are off by 5 nm in the root mean square over 8 ms, and by 0.2 um over many periods
_INSTANTS = 33, 64


class _Exposed(Model):
    """What every motion says of the exposure that it smears."""

    #: for sensors that have no exposure time of their own [s]
    exposure: Annotated[Seconds, Field(gt=0.0, le=10.0)] | None = None


class Velocity(_Exposed):
    """A steady velocity of the tip [mm/s], the same at every pose.

    >>> Velocity(velocity=(10.0, 0.0, 5.0)).sway(3.0, 0.008)[:, ::2].round(6).tolist()
    [[-0.04, -0.02], [0.04, 0.02]]
    """

    kind: Literal["velocity"] = "velocity"
    velocity: tuple[Speed, Speed, Speed]

    def times(self, poses: int) -> Array:
        """When poses are that say no time of their own `[poses]` [s]: here it does not matter."""
        return np.zeros(poses)

    def reach(self, exposure: float) -> float:
        """How far from mid-exposure the tip is at most during an `exposure` [s]; [mm]."""
        return math.hypot(*self.velocity) * exposure / 2.0

    def sway(self, time: float, exposure: float, seed: int = 0) -> Array:
        """Where the tip is at even instants of an `exposure` [s], first to last, off its mid-exposure `[K, 3]` [mm].

        A steady velocity is the same at any `time` [s] and for any `seed`.
        """
        return np.array([[-0.5], [0.5]]) * exposure * np.asarray(self.velocity)

    @property
    def words(self) -> str:
        """The motion in words, as tables state it."""
        return f"tip moving at {format_quantity(math.hypot(*self.velocity), 'speed')}"


class Tremor(_Exposed):
    """A hand's tremor: band-limited noise, Gaussian and alike along all axes, one function of time for each seed.

    `rms` is the root mean square distance of the tip from its planned place; its power lies evenly within `bandwidth`
    about `frequency`. As of any noise that is so in the long run: over T seconds the rms of one seed scatters by a
    share of up to 1 / (2 sqrt(3 bandwidth T)), 6 % over 10 s of 2 Hz.
    The trajectory states where the tip is at mid-exposure, so what the tremor adds to a frame is
    the way from there. Amplitude: C. N. Riviere, P. S. Jensen, A study of instrument motion in retinal microsurgery,
    Proc. IEEE EMBS 22, 2000. Poses of a trajectory without times of its own follow each other at `frame_rate`.
    """

    kind: Literal["tremor"] = "tremor"
    rms: Annotated[Length, Field(gt=0.0, le=5.0)] = 0.182
    frequency: Annotated[Hertz, Field(gt=0.0, le=100.0)] = 9.0
    bandwidth: Annotated[Hertz, Field(ge=NARROWEST)] = 2.0
    frame_rate: Annotated[Hertz, Field(gt=0.0, le=1e5)] = 60.0

    @model_validator(mode="after")
    def _above_nothing(self) -> Tremor:
        if self.bandwidth > 2.0 * self.frequency:
            raise ValueError("bandwidth must be at most twice the frequency, about which it lies")
        return self

    def times(self, poses: int) -> Array:
        """When poses are that say no time of their own `[poses]` [s]: frame after frame."""
        return np.arange(poses) / self.frame_rate

    def reach(self, exposure: float) -> float:
        """How far from mid-exposure the tip is at most during an `exposure` [s]; [mm]. All waves would have to meet."""
        furthest = self.rms * math.sqrt(2.0 * _WAVES)  # of sqrt(3) times the amplitude of all waves along an axis
        fastest = 2.0 * math.pi * (self.frequency + self.bandwidth / 2.0) * furthest
        return min(2.0 * furthest, fastest * exposure / 2.0)

    def smear(self, exposure: float) -> float:
        """Standard deviation along an axis of the tip's places during an `exposure` [s], in the mean over time [mm].

        A sinusoid of rms a and angular frequency w has in a window T the mean variance a^2 (1 - sinc^2(w T / 2)).
        """
        return self.rms * math.sqrt(float(np.mean(1.0 - np.square(np.sinc(self._rates() * exposure)))) / 3.0)

    def sag(self, exposure: float) -> float:
        """Standard deviation along an axis of how far the tip's mean place in an `exposure` [s] is off the middle one.

        In mm. The way is bent: in a window T about t the mean of a sinusoid is sinc(w T / 2) times what it is at t.
        """
        return self.rms * math.sqrt(float(np.mean(np.square(1.0 - np.sinc(self._rates() * exposure)))) / 3.0)

    def _rates(self) -> Array:
        """Frequencies of its band [1/s]."""
        low, high = (self.frequency + sign * self.bandwidth / 2.0 for sign in (-1.0, 1.0))
        return np.linspace(low, high, _WAVES)

    def displacement(self, times: ArrayLike, seed: int = 0) -> Array:
        """How far the tip is off its planned place `[..., 3]` [mm] at times `[...]` [s]."""
        rates, phases = _waves(self.frequency, self.bandwidth, seed)
        amplitude = self.rms * math.sqrt(2.0 / (3.0 * _WAVES))
        waves = np.sin(np.asarray(times, float)[..., None, None] * rates + phases)
        return np.asarray(amplitude * waves.sum(axis=-1))

    def sway(self, time: float, exposure: float, seed: int = 0) -> Array:
        """Where the tip is at even instants of an `exposure` [s], first to last, off its mid-exposure `[K, 3]` [mm].

        Mid-exposure is at `time` [s].
        """
        least, each = _INSTANTS
        fastest = self.frequency + self.bandwidth / 2.0
        instants = np.linspace(-0.5, 0.5, max(least, 1 + 2 * math.ceil(exposure * fastest * each / 2.0)))
        return self.displacement(time + exposure * instants, seed) - self.displacement(time, seed)

    @property
    def words(self) -> str:
        """The motion in words, as tables state it."""
        return (
            f"hand tremor {format_quantity(self.rms, 'length')} rms at {format_quantity(self.frequency, 'frequency')}"
        )


@functools.lru_cache(maxsize=16)
def _waves(frequency: float, bandwidth: float, seed: int) -> tuple[Array, Array]:
    """Angular frequencies [1/s] and phases [rad] `[3, waves]` of a tremor: one at random in each part of its band."""
    rng = np.random.default_rng(seed)
    parts = (np.arange(_WAVES) + rng.random((3, _WAVES))) / _WAVES
    rates = 2.0 * math.pi * (frequency + bandwidth * (parts - 0.5))
    return rates, rng.uniform(0.0, 2.0 * math.pi, (3, _WAVES))


Motion = Velocity | Tremor


def _written(value: Any) -> Any:
    if value == "none":
        return None
    return {"kind": value} if isinstance(value, str) else value


#: what the key of a file holds: `none`, a kind's name or the motion
AnyMotion = Annotated[
    Annotated[Motion, Field(discriminator="kind")] | None, BeforeValidator(_written), Words(lambda: ["none", "tremor"])
]


def exposure_of(motion: Motion, sensor: AnySensor) -> float:
    """How long the instrument moves in a frame [s]. Raises ValueError if that is not fixed, or stated twice."""
    if sensor.metering is not None:
        raise ValueError(
            "motion needs a fixed exposure time, and the sensor meters its own; write sensor.exposure_time in place of"
            " sensor.metering"
        )
    if sensor.exposure_time is None and motion.exposure is None:
        raise ValueError("motion needs an exposure time, and the sensor has none; write motion.exposure: 8 ms")
    if sensor.exposure_time is not None and motion.exposure is not None:
        raise ValueError("motion.exposure is for sensors without an exposure time; the sensor has exposure_time")
    return sensor.exposure_time or motion.exposure or 0.0


def poses_during(pose: Pose, rcm: ArrayLike) -> list[Pose]:
    """The poses of an instrument through `rcm` `[3]` [mm] at the instants of its sway; that one if it is still."""
    if pose.sway is None:
        return [pose]
    return [Pose.through(pose.apex + off, rcm) for off in pose.sway]


def extremes(pose: Pose, rcm: ArrayLike) -> list[Pose]:
    """Of `poses_during`, those that are furthest in any direction: what all of them light lies between these."""
    if pose.sway is None:
        return [pose]
    steps = np.arange(-2.0, 3.0)
    ways = np.stack(np.meshgrid(steps, steps, steps), axis=-1).reshape(-1, 3)
    furthest = np.unique(np.argmax(pose.sway @ ways.T, axis=0))
    return poses_during(replace(pose, sway=pose.sway[furthest]), rcm)
