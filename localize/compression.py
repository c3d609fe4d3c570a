"""Whether a frame went through JPEG: its blocks' frequencies are then multiples of the steps they were rounded to.

Z. Fan, R. L. de Queiroz, Identification of bitmap compression history: JPEG detection and quantizer estimation, IEEE
Trans. Image Processing 12 (2003). Compression moves edges by more than any sensor's noise, and all alike.
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from conespot.localize.image import AnyImage
from conespot.scene.jpeg import BLOCK, cosines, luminance_steps

Array = NDArray[np.float64]


@dataclass(frozen=True)
class CompressionSettings:
    """Tuned numbers of recognizing a compressed frame."""

    #: qualities that are looked for: above, steps are those of eight bits themselves
    qualities: range = range(30, 98)
    #: steps [levels] below which whole pixel values hide the multiples
    least_step: float = 3.0
    #: share of a step below which a frequency counts as rounded away and says nothing
    rounded_away: float = 0.5
    #: sigmas of a chance agreement, the largest of 68 qualities': once in ten million frames
    agreement: float = 7.0
    #: frequencies that must speak
    fewest: int = 40


COMPRESSION = CompressionSettings()


def compressed(pixels: AnyImage, rows: slice, columns: slice) -> bool:
    """Whether a part of a frame of eight bits shows the rounding of a JPEG; False for other types of pixels."""
    if pixels.dtype != np.uint8:
        return False
    top, left = (-(-part.start // BLOCK) * BLOCK for part in (rows, columns))
    height, width = ((part.stop - start) // BLOCK for part, start in ((rows, top), (columns, left)))
    if height < 1 or width < 1:
        return False
    seen = pixels[top : top + height * BLOCK, left : left + width * BLOCK]
    luma = cv2.cvtColor(seen, cv2.COLOR_RGB2YCrCb)[..., 0] if seen.ndim == 3 else seen
    blocks = luma.reshape(height, BLOCK, width, BLOCK).transpose(0, 2, 1, 3).reshape(-1, BLOCK, BLOCK)
    wave = cosines()
    return agreement(wave @ blocks.astype(float) @ wave.T) > COMPRESSION.agreement


def agreement(frequencies: Array) -> float:
    """How well blocks' frequencies `[N, 8, 8]` agree with the multiples of the best quality's steps [sigmas]."""
    best = 0.0
    speaking = np.abs(frequencies) > COMPRESSION.rounded_away * COMPRESSION.least_step  # at any quality
    speaking[:, 0, 0] = False
    _, row, column = np.nonzero(speaking)
    found = frequencies[speaking]
    for quality in COMPRESSION.qualities:
        steps = luminance_steps(quality).astype(float)[row, column]
        told = (steps >= COMPRESSION.least_step) & (np.abs(found) > COMPRESSION.rounded_away * steps)
        count = int(np.count_nonzero(told))
        if count >= COMPRESSION.fewest:
            phases = found[told] / steps[told]
            best = max(best, float(np.sum(np.cos(2.0 * np.pi * phases))) / float(np.sqrt(count / 2.0)))
    return best
