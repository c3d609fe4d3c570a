"""Beam profiles averaged over a pixel of a blurred image, in closed form.

A profile of truncated powers, g = sum c (w - k)_+^d over knots k and degrees d, under a Gaussian of deviation s:

    E[(x + s Z)_+^n] / n! = s^n N_n(x / s),   N_n' = N_(n-1),   n N_n(t) = t N_(n-1) + N_(n-2),

with N_0 the normal distribution and N_(-1) its density, so antiderivatives and derivatives of the blurred profile are
the same sum, orders further up or down the ladder.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from conespot.localize.model.profile import Profile

Array = NDArray[np.float64]
#: standard deviations beyond which a Gaussian holds nothing: 2e-9 of it
_FAR = 6.0
#: the projection of a disc of radius 1 as Gaussians of one standard deviation: places and weights on either side of
#: the middle that keep its variance of 1/4 and leave the least difference of the two distributions, 0.0035
_WIDTH = 0.1235
_PLACES = (0.1505, 0.4515, 0.7583)
_WEIGHTS = (0.19122, 0.17383, 0.13495)
_DISC = [(sign * place, weight) for place, weight in zip(_PLACES, _WEIGHTS, strict=True) for sign in (1.0, -1.0)]


@dataclass(frozen=True)
class Smooth:
    """Pixel means at N pixels."""

    mean: Array
    slope: Array  #: its derivative by w
    curvature: Array  #: its second derivative; half of it is the mean's derivative by the variance (heat equation)
    third: Array  #: the third derivative by w


def smoothed(profile: Profile, w: Array, px: Array, py: Array, variance: Array, disc: Array) -> Smooth:
    """Means over pixels, where w rises by 2 px and 2 py along their sides, of an image spread by a disc and a Gaussian.

    Both are given as w sees them `[N]`: the Gaussian's `variance` and the radius of the `disc`. A step under a disc is
    right to 0.4 % of it, under a Gaussian to 0.04 %.
    """
    if not np.any(disc):
        return Smooth(*_smoothed(profile, w, px, py, variance))
    found = np.zeros((4, len(w)))
    for place, weight in _DISC:
        found += weight * _smoothed(profile, w + place * disc, px, py, variance + np.square(_WIDTH * disc))
    return Smooth(*found)


def smeared(profile: Profile, w: Array, px: Array, py: Array, variance: Array, half: Array) -> Smooth:
    """The same of an image spread by a Gaussian and an even way, from `half` before to `half` behind `[N]`: exact."""
    half = np.maximum(half, 1e-3 * (px + py))
    before, behind = (_smoothed(profile, w + sign * half, px, py, variance, 1) for sign in (1.0, -1.0))
    return Smooth(*(before - behind) / (2.0 * half))


def _smoothed(profile: Profile, w: Array, px: Array, py: Array, variance: Array, below: int = 0) -> Array:
    """Mean and three derivatives `[4, N]` under a Gaussian, or as many orders `below` them."""
    box = (np.square(px) + np.square(py)) / 3.0
    # a pixel under a Gaussian as wide as half of it: its own variance and kurtosis are all of it that shows
    wide = variance > 3.0 * box
    found = np.zeros((4, len(w)))
    if wide.any():
        at = np.flatnonzero(wide)
        sharpness = -(px[at] ** 4 + py[at] ** 4) * (2.0 / 15.0 / 24.0)
        rungs = ladder(profile, w[at], np.sqrt(variance[at] + box[at]), range(-below, 8 - below))
        found[:, at] = rungs[:4] + sharpness * rungs[4:]
    if not wide.all():
        at = np.flatnonzero(~wide)
        found[:, at] = _differences(profile, w[at], px[at], py[at], variance[at], box[at], below)
    return found


def _differences(profile: Profile, w: Array, px: Array, py: Array, variance: Array, box: Array, below: int) -> Array:
    """The same as second differences over the pixel, near knots."""
    # away from the knots a cubic's mean is exact with the pixel's variance
    reach = px + py + _FAR * np.sqrt(variance + box)
    near = np.any(np.abs(w - profile.knots[:, None]) < reach, axis=0)
    found = np.zeros((4, len(w)))
    far = np.flatnonzero(~near)
    found[:, far] = ladder(profile, w[far], np.sqrt(variance[far] + box[far]), range(-below, 4 - below))
    at = np.flatnonzero(near)
    a, p, q = w[at], px[at], py[at]
    floor = np.maximum(1e-3 * np.maximum(p, q), 1e-9)
    p, q = np.maximum(p, floor), np.maximum(q, floor)
    sigma = np.maximum(np.sqrt(variance[at]), floor)
    for sign, corner in ((1.0, a + p + q), (-1.0, a + p - q), (-1.0, a - p + q), (1.0, a - p - q)):
        found[:, at] += sign * ladder(profile, corner, sigma, range(-2 - below, 2 - below)) / (4.0 * p * q)
    return found


def ladder(profile: Profile, w: Array, sigma: Array, orders: range) -> Array:
    """Derivatives of some `orders`, negative ones antiderivatives, of the profile under Gaussians `[orders, N]`."""
    found = np.zeros((len(orders), len(w)))
    degrees = profile.jumps.shape[1]
    for knot, jumps in zip(profile.knots, profile.jumps, strict=True):
        at = np.flatnonzero(w > knot - _FAR * sigma)
        if not len(at):
            continue
        s = sigma[at]
        t = (w[at] - knot) / s
        steps = _steps(t, degrees - 1 - orders[0], orders[-1])
        for degree in np.flatnonzero(jumps):
            size = jumps[degree] * math.factorial(degree)
            for row, order in enumerate(orders):
                rung = steps.get(int(degree) - order)
                if rung is not None:
                    found[row, at] += size * s ** (int(degree) - order) * rung
    return found


def under_gaussian(profile: Profile, w: Array, sigma: Array, derivatives: int) -> list[Array]:
    """The profile under Gaussians `[N]` and so many derivatives: the first rungs of a `ladder`, all knots at a time."""
    first, last = profile.knots[0], profile.knots[-1]
    reach = _FAR * sigma
    near = np.flatnonzero((w > first - reach) & (w < last + reach))
    # beyond the last knot every profile is constant, before the first it is dark
    found = [np.where(w < last, 0.0, profile.coefficients[-1, 0]), *(np.zeros_like(w) for _ in range(derivatives))]
    s = sigma[near]
    steps = _rungs((w[near] - profile.knots[:, None]) / s, profile.jumps.shape[1] - 1)
    powers: dict[int, Array | float] = {3: s * s * s, 2: s * s, 1: s, 0: 1.0, -1: 1.0 / s, -2: 1.0 / (s * s)}
    for order, whole in enumerate(found):
        total = np.zeros_like(s)
        for degree, size in profile.powers:
            total += (size @ steps[degree - order]) * powers[degree - order]
        whole[near] = total
    return found


def _rungs(t: Array, highest: int) -> dict[int, Array]:
    """N_n(t) for n from -2 to `highest`, of any shape."""
    from scipy.special import ndtr  # as in `_steps`

    phi, whole = np.exp(-0.5 * np.square(t)) / math.sqrt(2.0 * math.pi), ndtr(t)
    steps = {-2: -t * phi, -1: phi, 0: whole}
    for n in range(1, highest + 1):
        steps[n] = (t * steps[n - 1] + steps[n - 2]) / n
    return steps


def _steps(t: Array, highest: int, lowest: int) -> dict[int, Array]:
    """N_n(t) for n from -`lowest` to `highest`."""
    from scipy.special import ndtr  # every process of a campaign would wait for it

    near = np.flatnonzero(t < _FAR)
    phi, whole = np.zeros_like(t), np.ones_like(t)
    phi[near] = np.exp(-0.5 * np.square(t[near])) / math.sqrt(2.0 * math.pi)
    whole[near] = ndtr(t[near])
    steps = {-1: phi, 0: whole}
    for n in range(1, highest + 1):
        steps[n] = (t * steps[n - 1] + steps[n - 2]) / n
    # downwards: N_(n-2) = n N_n - t N_(n-1)
    for n in range(0, -lowest + 1, -1):
        steps[n - 2] = n * steps[n] - t * steps[n - 1]
    return steps
