"""Tracing a list of pixels at once, in the JIT variants: one kernel for a scene, whichever pixels are asked for."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any, Literal, assert_never, cast

import numpy as np
from numpy.typing import NDArray

from conespot.render import kernel
from conespot.render.rays import RayGenerator
from conespot.render.source import Source, Standing

if TYPE_CHECKING:
    from drjit.auto.ad import Bool, Float, UInt32
    from mitsuba import RayDifferential3f, SamplingIntegrator, Scene, Spectrum

#: how light comes to what the camera sees: from the emitter, which nothing can hide; from the emitter, unless something
#: does; or by the integrator's paths
Transport = Literal["unblocked", "direct", "path"]


def trace(
    loaded: Scene,
    camera: RayGenerator,
    pixels: NDArray[np.uint32],
    width: int,
    samples: int,
    seed: int,
    *,
    transport: Transport,
    source: Source | None = None,
    grey: Sequence[float] | None = None,
    halves: bool = False,
) -> NDArray[np.float32]:
    """What the film's channels see `[N, C]` of the pixels `[N]` (row * width + column) of a Mitsuba scene.

    Rays are the `camera`'s, wavelengths and channels those of the film of the Mitsuba sensor. Each sample takes a cell
    of its own of the pixel's area, and one of the film's wavelengths; a pixel's depend on `seed` and its place in the
    frame, not on the other pixels asked for. Where light that is reflected twice goes depends on those too. Where all
    wavelengths are alike, `grey` has the integral of each channel's response. With `halves`, `[N, 2, C]`: of each half
    of the samples, which lie on the pixel's cells like a chequerboard's two colours. A `source` takes the place of an
    emitter that is a still point. `glow` is what the retina adds to light reflected once.
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
    column, row = _cell(k, samples, columns, halves)
    across, along = (column + random.next_float32()) / columns, (row + random.next_float32()) * (columns / samples)
    x, y = camera.on_film(pixel % width, pixel // width, across, along)
    # a ray carries four wavelengths, each a quarter of the range from the next: cells of a quarter tell them all apart.
    # Cells of area and of wavelength are paired at random, or colours would lie across the pixel.
    cells = samples if camera.disperses else 4 * samples
    wavelength = (mi.Float(mi.permute_kensler(k, samples, first)) + random.next_float32()) / cells
    wavelengths, weight = sensor.sample_wavelengths(dr.zeros(mi.SurfaceInteraction3f), wavelength)
    if camera.disperses:  # light of one wavelength goes this way, so cells of the whole range tell them apart
        wavelengths, weight = mi.Spectrum(wavelengths[0]), mi.Spectrum(weight[0])
    place = None
    if camera.has_aperture:  # each sample has a cell of the pupil too, and so has each half's
        several = samples // 2 if halves else samples
        cell = mi.permute_kensler(k % several, several, second) + (k - k % several)
        across, along = _cell(cell, samples, columns, halves)
        unit = (across + random.next_float32()) / columns, (along + random.next_float32()) * (columns / samples)
        place = mi.warp.square_to_uniform_disk_concentric(mi.Point2f(*unit))
    ray, seen = camera.rays(x, y, wavelengths, place)
    stands = None
    if source is not None:
        # cells of the core and of the exposure too, each paired with those of area at random
        third, fourth = mi.sample_tea_32(second, first)
        cell = mi.permute_kensler(k, samples, third)
        across = (mi.Float(cell % columns) + random.next_float32()) / columns
        along = (mi.Float(cell // columns) + random.next_float32()) * (columns / samples)
        instant = (mi.Float(mi.permute_kensler(k, samples, fourth)) + random.next_float32()) / samples
        stands = source.at(mi.Point2f(across, along), instant)
    match transport:
        case "unblocked":
            light, met = _unblocked(loaded, ray, stands)
        case "direct":
            light, met = _direct(loaded, ray, stands)
        case "path":
            bounces = mi.load_dict({"type": "independent"})
            bounces.seed(seed, len(pixels) * samples)
            paths = cast("SamplingIntegrator", loaded.integrator())
            light, met, _ = paths.sample(loaded, bounces, ray)
        case _:
            assert_never(transport)
    met &= seen
    if grey is None:
        values = film.prepare_sample(weight * light, ray.wavelengths, channels, 1.0, 1.0, met)[:-1]
    else:
        values = [light[0] * integral for integral in grey]
    block = samples // 2 if halves else samples
    sums = [dr.block_sum(dr.select(met, value, 0.0), block) for value in values]
    dr.eval(sums)
    means = np.stack([np.asarray(total) / np.float32(block) for total in sums], axis=-1, dtype=np.float32)
    return means.reshape(-1, 2, len(values)) if halves else means


def _cell(k: UInt32, samples: int, columns: int, halves: bool) -> tuple[Float, Float]:
    """Column and row of the `k`-th of so many samples' cells; those of `halves` lie like a chequerboard's colours."""
    mi, _, _ = kernel.load()
    column, row = k % columns, k // columns
    if halves:
        half, place = k // (samples // 2), k % (samples // 2)
        row = place // (columns // 2)
        column = 2 * (place % (columns // 2)) + (row + half) % 2
    return mi.Float(column), mi.Float(row)


def _unblocked(loaded: Any, ray: RayDifferential3f, stands: Standing | None) -> tuple[Spectrum, Bool]:
    """What the scene's one shape sends back of the one emitter's light, if nothing can come between them.

    The same as `_direct` to the last bit and twice as fast: shape, emitter and BSDF are met in closed form, in the
    kernel itself, where a scene asks Embree for the first and calls whichever the others turn out to be.
    """
    mi, dr, _ = kernel.load()
    shape, emitter = loaded.shapes()[0], loaded.emitters()[0]
    at = shape.ray_intersect(ray, mi.RayFlags.All)
    met = at.is_valid()
    towards, emitted = emitter.sample_direction(stands.seen_from(at) if stands else at, mi.Point2f(0.5), met)
    direction = dr.normalize(stands.position - at.p) if stands else towards.d
    reflected = shape.bsdf().eval(mi.BSDFContext(), at, at.to_local(direction), met)
    return emitted * reflected, met


def _direct(loaded: Any, ray: RayDifferential3f, stands: Standing | None) -> tuple[Spectrum, Bool]:
    """What the scene's one emitter, a point or a direction, sends back along rays, and which of them meet anything.

    Mitsuba's `direct` integrator does the same, and weighs it against light that BSDF samples would find: here none.
    """
    mi, dr, _ = kernel.load()
    at = loaded.ray_intersect(ray, mi.RayFlags.All, True, True)
    met = at.is_valid()
    if stands is None:
        towards, emitted = loaded.sample_emitter_direction(at, mi.Point2f(0.5), True, met)
        direction = towards.d
    else:
        _, emitted = loaded.emitters()[0].sample_direction(stands.seen_from(at), mi.Point2f(0.5), met)
        hidden = loaded.ray_test(at.spawn_ray_to(stands.position), met)
        emitted = dr.select(hidden, 0.0, emitted)
        direction = dr.normalize(stands.position - at.p)
    reflected = at.bsdf(ray).eval(mi.BSDFContext(), at, at.to_local(direction), met)
    return emitted * reflected, met
