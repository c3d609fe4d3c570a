"""Frames of a moving needle, made with the forward model alone: no Mitsuba, a few milliseconds a frame."""

import numpy as np

from conespot.localize.model.forward import ambient_irradiance, light
from conespot.localize.model.profile import Profile
from conespot.localize.model.sight import look, window
from conespot.scene import Pose, Scene
from conespot.scene.camera import Camera
from conespot.scene.motion import Tremor
from conespot.scene.sensor import Linear

#: of an exposure that are added up
INSTANTS = 5


class MovingNeedle:
    """A tip on a slow line with a tremor on it, filmed at 120 Hz with an exposure of 5 ms over an even retina."""

    rate_hz, exposure_s = 120.0, 0.005

    def __init__(self, resolution=300, *, seed=1, noise=0.003, **parts):
        self.scene = Scene(camera=Camera(resolution=resolution), sensor=Linear(white=1.0, bits=12), **parts)
        self._rng = np.random.default_rng(seed)
        self._seed, self._noise = seed, noise
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
            for instant in np.linspace(-0.5, 0.5, INSTANTS) * self.exposure_s + time:
                pose = Pose.through(self.tip(instant), self.scene.instrument.rcm)
                rows, columns = self._reached(pose)
                size = self.scene.camera.resolution
                at = (np.arange(size * size).reshape(size, size)[rows, columns]).ravel()
                sight = self._sight.part(at)
                shone = light(sight, pose, self.scene, Profile.of(self.scene.beam))
                signal[at] += np.nan_to_num(shone.value) * 3.0 / INSTANTS
        size = self.scene.camera.resolution
        noisy = signal + self._rng.normal(0.0, self._noise, signal.shape)
        return np.clip(np.rint(4095.0 * noisy), 0, 4095).astype(np.uint16).reshape(size, size)

    def _reached(self, pose):
        points = self.scene.camera.project(self.scene.outline(pose, 0, 48))
        low = np.clip(np.floor(points.min(axis=0)).astype(int) - 4, 0, None)
        high = np.ceil(points.max(axis=0)).astype(int) + 4
        return slice(low[1], high[1]), slice(low[0], high[0])
