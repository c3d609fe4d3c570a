"""What a JPEG does to an edge: its blocks' frequencies are rounded, which the model's own light predicts.

An edge's frequencies are larger than the steps or rounded away, whatever the sensor's noise is: the rounding is hardly
noise, and the same around an outline. It makes the foot of a step brighter, where a fit looks first: at quality 90
pixels of 0.3 to 3 % of the step by two to three codes in the mean.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from conespot.localize.edge.nuisances import Nuisances
from conespot.localize.edge.ribbon import Ribbon
from conespot.localize.edge.settings import EDGE
from conespot.localize.image import Frame
from conespot.localize.model.noise import NoiseModel, SensorNoise
from conespot.localize.model.view import Shown
from conespot.scene.jpeg import BLOCK, cosines, luminance_steps
from conespot.scene.sensor import Recorded

Array = NDArray[np.float64]
_WAVES = np.arange(1, 6)  # of the sawtooth that rounding is


@dataclass(frozen=True)
class Rounding:
    """Of a grey frame's pixels along the outlines."""

    recorder: Recorded
    shown: Shown  #: what they show, rounded
    codes: Array  #: of whole blocks `[8 h, 8 w]`
    inside: NDArray[np.bool_]  #: which of the pixels are in these `[N]`
    cells: tuple[NDArray[np.intp], NDArray[np.intp]]  #: and where
    recorded: Array  #: codes of all `[N]`

    @classmethod
    def of(cls, frame: Frame, band: Ribbon, noise: NoiseModel) -> tuple[Rounding | None, NoiseModel]:
        """Of a band whose bins are pixels, and the noise that stays; None in colours, or where nothing recorded it."""
        grey = frame.pixels.dtype == np.uint8 and frame.pixels.ndim == 2
        if not (isinstance(frame.sensor, Recorded) and grey and band.at.side == 1):
            return None, noise
        every = band.at.row + band.cells[0], band.at.column + band.cells[1]
        low = [int(at.min()) // BLOCK * BLOCK for at in every]
        high = [
            min(-(-(int(at.max()) + 1) // BLOCK), side // BLOCK) * BLOCK
            for at, side in zip(every, frame.pixels.shape, strict=True)
        ]
        inside = (every[0] < high[0]) & (every[1] < high[1])
        codes = frame.pixels[low[0] : high[0], low[1] : high[1]].astype(float)
        cells = every[0][inside] - low[0], every[1][inside] - low[1]
        if isinstance(noise, SensorNoise):
            noise = replace(noise, compression=EDGE.unpredicted * noise.compression)
        return cls(frame.sensor, band.shown[0], codes, inside, cells, frame.pixels[every].astype(float)), noise

    def without(self, model: Array) -> Shown:
        """What the pixels show less the rounding of the light `model` `[N]` [white]."""
        codes = self.recorded - self._of(self._code(model))
        share = np.clip(codes / self.recorder.full_scale, 0.0, 1.0)
        return replace(self.shown, signal=self.recorder.decode(share))

    def lets_through(self, information: Array, prior: Array, channel: Nuisances) -> Array:
        """What is left of `information` `[P, P]` beside the `prior`'s: frequencies rounded away show no displacement.

        The share is that of the tip's height, moved by a sigma of its own either way.
        """
        row, model = channel.rows[2], channel.model
        told = float(channel.weights @ np.square(row))
        move = row / np.sqrt(told)
        brighter, darker = model * np.exp(move), model * np.exp(-move)
        far, near = self._code(brighter), self._code(darker)
        rounded = (self._of(far) - self._of(near)) * (brighter - darker)
        change = np.divide(rounded, far - near, out=np.zeros_like(row), where=np.abs(far - near) > 1e-9)
        kept = 1.0 + float((channel.weights * move) @ (change / model)) / 2.0
        return np.asarray(np.clip(kept, EDGE.least_through, 1.0) * (information - prior) + prior)

    def _code(self, model: Array) -> Array:
        codes = np.arange(self.recorder.full_scale + 1.0)
        return np.interp(np.minimum(model, 1.0), self.recorder.decode(codes / self.recorder.full_scale), codes)

    def _of(self, codes: Array) -> Array:
        """The expected rounding `[N]` of pixels' codes `[N]`, with the noise that frequencies have."""
        plane = self.codes.copy()
        plane[self.cells] = codes[self.inside]
        height, width = (side // BLOCK for side in plane.shape)
        blocks = (plane - 128.0).reshape(height, BLOCK, width, BLOCK).transpose(0, 2, 1, 3)
        steps, wave = luminance_steps(self.recorder.quality).astype(float), cosines()
        phase = 2.0 * np.pi * (wave @ blocks @ wave.T) / steps
        rounded = np.zeros_like(phase)
        for k in _WAVES:
            size = (-1.0) ** k / (np.pi * k) * steps * np.exp(-2.0 * np.square(np.pi * k * EDGE.code_noise / steps))
            rounded += size * np.sin(k * phase)
        back = (wave.T @ rounded @ wave).transpose(0, 2, 1, 3).reshape(plane.shape)
        found = np.zeros(len(codes))
        found[self.inside] = back[self.cells]
        return found
