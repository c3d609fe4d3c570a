"""Tracing a list of pixels at once, in the JIT variants: one kernel for a scene, whichever pixels are asked for."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from conespot.render import kernel


def trace(loaded: Any, pixels: NDArray[np.uint32], width: int, samples: int, seed: int) -> NDArray[np.float32]:
    """What the film's channels see `[N, C]` of the pixels `[N]` (row * width + column) of a Mitsuba scene.

    The film must have the frame's first pixel as its crop. Each sample takes a cell of its own of the pixel's area, and
    one of the film's wavelengths; a pixel's depend on `seed` and its place in the frame, not on the other pixels asked
    for. Where light that is reflected twice goes depends on those too.
    """
    mi, dr, _ = kernel.load()
    sensor = loaded.sensors()[0]
    film = sensor.film()
    channels = film.prepare([])  # and one for weights
    lane = dr.arange(mi.UInt32, len(pixels) * samples)
    pixel = dr.gather(mi.UInt32, mi.UInt32(pixels), lane // samples)
    k = lane % samples
    # a literal would be a constant of the kernel, which were compiled anew for every seed
    first, second = mi.sample_tea_32(pixel, dr.opaque(mi.UInt32, seed))
    state, sequence = mi.sample_tea_32(first + k, second)
    random = mi.PCG32(initstate=mi.UInt64(state), initseq=mi.UInt64(sequence))
    columns = max(d for d in range(1, int(samples**0.5) + 1) if samples % d == 0)
    x = mi.Float(pixel % width) + (mi.Float(k % columns) + random.next_float32()) / columns
    y = mi.Float(pixel // width) + (mi.Float(k // columns) + random.next_float32()) * (columns / samples)
    # a ray carries four wavelengths, each a quarter of the range from the next: cells of a quarter tell them all apart.
    # Cells of area and of wavelength are paired at random, or colours would lie across the pixel.
    wavelength = (mi.Float(mi.permute_kensler(k, samples, first)) + random.next_float32()) / (4 * samples)
    bounces = mi.load_dict({"type": "independent"})
    bounces.seed(seed, len(pixels) * samples)
    # the sensor takes a place in units of its film's crop, which is one pixel
    ray, weight = sensor.sample_ray_differential(0.0, wavelength, mi.Point2f(x, y), mi.Point2f(0.5))
    light, met, _ = loaded.integrator().sample(loaded, bounces, ray)
    values = film.prepare_sample(weight * light, ray.wavelengths, channels, 1.0, 1.0, met)
    sums = [dr.block_sum(dr.select(met, value, 0.0), samples) for value in values[:-1]]
    dr.eval(sums)
    return np.stack([np.asarray(total) / np.float32(samples) for total in sums], axis=-1, dtype=np.float32)
