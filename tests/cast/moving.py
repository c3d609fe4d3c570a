"""Frames of a moving needle, made with the forward model alone: no Mitsuba, a few milliseconds a frame."""

import numpy as np

from conespot.localize.model.forward import ambient_irradiance, light
from conespot.localize.model.profile import Profile
from conespot.localize.model.sight import look, window
from conespot.scene import Pose, Scene
from conespot.scene.beam import CyclesBeam
from conespot.scene.camera import Camera
from conespot.scene.emva import Emva
from conespot.scene.lens import Lens
from conespot.scene.motion import Tremor
from conespot.scene.point_spread import GaussianSpread
from conespot.scene.sensor import Linear
from conespot.scene.spotlights import RIGS

#: of an exposure that are added up
INSTANTS = 5


class MovingNeedle:
    """A tip on a slow line with a tremor on it, filmed at 120 Hz with an exposure of 5 ms over an even retina.

    The scene tells of the tremor's exposure; one of 0 s is sharp, and nothing to tell. `like_theatre` has the core and
    the blur of `preset: theatre` as well. `emva` is a camera that says what noise it has; else it has `noise` [white],
    and says none.
    """

    rate_hz = 120.0

    def __init__(
        self,
        resolution=300,
        *,
        seed=1,
        noise=0.003,
        exposure_s=0.005,
        like_theatre=False,
        blur_mm=0.0,
        rig="single",
        emva=False,
        beam=None,
        instants=INSTANTS,
    ):
        blur_mm = 0.0057 if like_theatre else blur_mm
        lens = Lens(blur=GaussianSpread(sigma=blur_mm)) if blur_mm else None
        self.scene = Scene(
            camera=Camera(resolution=resolution, lens=lens),
            beam=beam or CyclesBeam(source_diameter=0.1 if like_theatre else 0.0),
            spotlights=RIGS[rig],
            sensor=Emva(exposure_time=exposure_s or 0.001) if emva else Linear(white=1.0, bits=12),
            motion=Tremor(rms=0.18, exposure=None if emva else exposure_s) if exposure_s else None,
        )
        # what lights an instant is not smeared: the mean of a tremor is in a scene that has one
        self._still = self.scene.model_copy(update={"motion": None})
        self.exposure_s = exposure_s
        self._instants = instants if exposure_s else 1
        self._rng = np.random.default_rng(seed)
        # planes that are shifted at random: new ones for each frame take longer than all else
        spread = 1.0 if emva else noise
        self._noise = [self._rng.normal(0.0, spread, (resolution, resolution)) for _ in range(8)]
        self._black = self.scene.sensor.black_level / 4095.0 if emva else 0.0
        self._emva = emva
        self._seed = seed
        self._tremor = Tremor(rms=0.18)
        self._pixels = window(0, 0, resolution, resolution)
        self._sight = look(self.scene, self._pixels)
        self._ambient = 0.05 * ambient_irradiance(self._sight, self.scene)

    def tip(self, time):
        """Where the tip is [mm]."""
        slow = np.array([0.6 * np.sin(0.9 * time), 0.8 * np.cos(0.7 * time), 4.0 + 0.4 * np.sin(0.5 * time)])
        return slow + self._tremor.displacement(time, self._seed)

    def frame(self, time, dark=False):
        """The frame `[H, W]` at mid-exposure `time` [s], 12 bits; `dark` without the spotlight."""
        signal = self._ambient.copy()
        if not dark:
            # the middles of equal parts of the exposure
            parts = (np.arange(self._instants) + 0.5) / self._instants - 0.5
            for instant in parts * self.exposure_s + time:
                pose = Pose.through(self.tip(instant), self.scene.instrument.rcm)
                rows, columns = self._reached(pose)
                size = self.scene.camera.resolution
                at = (np.arange(size * size).reshape(size, size)[rows, columns]).ravel()
                sight = self._sight.part(at)
                shone = light(sight, pose, self._still, Profile.of(self.scene.beam))
                signal[at] += np.nan_to_num(shone.value) * 3.0 / len(parts)
        size = self.scene.camera.resolution
        which, down, right = self._rng.integers(0, [len(self._noise), size, size])
        noise = np.roll(self._noise[which], (down, right), (0, 1))
        if self._emva:
            noise *= np.sqrt(self.scene.sensor.noise.variance(signal)).reshape(size, size)
        noisy = signal.reshape(size, size) + noise + self._black
        return np.clip(np.rint(4095.0 * noisy), 0, 4095).astype(np.uint16)

    def _reached(self, pose):
        outlines = [self.scene.outline(pose, k, 48) for k in range(len(self.scene.spotlights))]
        points = self.scene.camera.project(np.concatenate(outlines))
        low = np.clip(np.floor(points.min(axis=0)).astype(int) - 4, 0, None)
        high = np.ceil(points.max(axis=0)).astype(int) + 4
        return slice(low[1], high[1]), slice(low[0], high[0])
