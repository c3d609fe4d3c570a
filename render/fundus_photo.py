"""Vessels, pigment and disc from the fundus photograph (M. Haggstrom, CC0; render/data/retina.jpg).

The photograph is a camera's picture: its patterns are used, never its brightness.
"""

from __future__ import annotations

import functools
from dataclasses import dataclass
from importlib import resources
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from conespot.render.fundus_anatomy import COARSE, FINE, Anatomy, Map, texel_centres
from conespot.scene import fundus, srgb


@dataclass(frozen=True)
class Photograph:
    """How the photograph is read; lengths in its pixels, densities to the base 10.

    Places are read off it. The other numbers were chosen by eye, on its mask of vessels and the maps at 570 and 850 nm;
    what they must keep is in tests/unit/render/test_fundus_maps.py, against the closed form.
    """

    texel: float = 0.01  #: [mm]: it shows 14 mm on 1411 px
    side: int = 1411
    field: tuple[float, float, float] = (705.0, 705.0, 680.0)  #: centre (x, y) and radius of its round field
    fovea: tuple[float, float] = (706.0, 697.0)
    disc: tuple[float, float, float, float] = (218.0, 645.0, 97.0, 112.0)  #: centre (x, y) and semi-axes
    disc_rim: float = 0.03  #: width of the disc's edge over its radius
    disc_from: float = 0.02  #: pigment is not read where there is that much disc
    fade: float = 20.0  #: what must not be reflected at the field's rim falls to 0 within this
    darkest: float = 1e-3  #: light below does not count
    antialias: float = 0.4  #: blur before sampling, in texels of the map that is made, standard deviation

    # vessels: dark ridges of the green channel
    scales: tuple[float, ...] = (1.4, 2.0, 3.0, 4.5, 6.5)  #: standard deviations sought, a vessel's half widths
    scale_exponent: float = 1.5  #: by which wide and narrow ridges of equal depth count about alike
    weak: float = 87.0  #: percentile of ridge strength that may be vessel where it touches
    strong: float = 95.0  #: one above this
    longest_speck: int = 30  #: what is neither longer
    largest_speck: int = 90  #: nor larger [px^2] is noise
    wider: int = 7  #: diameter by which the mask is widened before the background around it is taken
    background: float = 14.0  #: width of that, standard deviation: over twice the widest vessel's
    soft: float = 0.7  #: blur of the mask's edge, standard deviation
    soft_gain: float = 2.0  #: and what makes it 1 again on the vessel

    # arteries and veins, told apart by the ratio of densities in red and green
    along: float = 12.0  #: length of vessel over which it is averaged, standard deviation
    around: float = 10.0  #: times as wide is the neighbourhood it is compared in
    thick: float = 60.0  #: percentile of green density from which on a vessel counts in it
    steepness: float = 4.0  #: of the decision, per deviation of the ratio

    # blood paths
    least_excess: float = 0.02  #: density over the background below which nothing is vessel
    darkest_vessels: float = 97.0  #: percentile of the density that gets the closed form's path of a large vessel
    most_density: float = 1.05  #: of that density
    most_path: float = 1.5  #: of that path

    # pigment: what varies between these two blurs [standard deviations], 0.03 to 0.9 mm, filled in below the vessels
    fill: float = 5.0
    fine: float = 3.0
    coarse: float = 90.0
    melanin_density: float = 0.8  #: at 650 nm, per relative change of it and unit of Dme: 2 (650 / 500)^-3.33
    blood_density: float = 0.25  #: at 550 nm, per relative change of the choroid's blood
    blood_share: float = 0.5  #: of what green shows beyond red, which is taken for blood
    most_melanin: float = 0.25  #: relative changes are cut off at these
    most_blood: float = 0.35
    most_epithelium: float = 0.3


PHOTO = Photograph()


def disc_centre() -> tuple[float, float]:
    """Arc coordinates of the disc's centre [mm], fovea at the origin."""
    return (PHOTO.disc[0] - PHOTO.fovea[0]) * PHOTO.texel, -(PHOTO.disc[1] - PHOTO.fovea[1]) * PHOTO.texel


@functools.cache
def photographed() -> Anatomy:
    """The photograph's pattern, continued beyond its field by reflection."""
    linear = _linear_photo()
    density = -np.log10(np.maximum(linear, PHOTO.darkest))  # [H, W, 3], blue first
    green, red = density[..., 1], density[..., 2]
    vesselness = _dark_ridges(green)
    mask = _vessel_mask(vesselness)
    wide = cv2.dilate(mask, cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (PHOTO.wider, PHOTO.wider))).astype(np.uint8)
    green_excess = green - _background(green, wide, PHOTO.background)
    red_excess = red - _background(red, wide, PHOTO.background)
    soft = cv2.GaussianBlur(mask.astype(np.float32), (0, 0), PHOTO.soft)
    weight = np.clip(PHOTO.soft_gain * soft, 0.0, 1.0) * np.maximum(green_excess, 0.0)
    venous = _venous(green_excess, red_excess, mask)
    artery, vein = (_paths(weight * share, saturation, depth) for share, saturation, depth in (
        (1.0 - venous, fundus.BLOOD.artery_saturation, fundus.BLOOD.artery_depth),
        (venous, fundus.BLOOD.vein_saturation, fundus.BLOOD.vein_depth),
    ))  # fmt: skip
    disc = _disc_mask()
    melanin, blood, epithelium = _pigment(green, red, np.maximum(wide, (disc > PHOTO.disc_from).astype(np.uint8)))
    return Anatomy(
        disc_centre=disc_centre(),
        melanin=_onto(melanin, COARSE),
        blood=_onto(blood, COARSE),
        epithelium=_onto(epithelium, COARSE),
        disc=_onto(disc, COARSE, fade=True),
        artery=_onto(artery, FINE, fade=True),
        vein=_onto(vein, FINE, fade=True),
    )


def _linear_photo() -> NDArray[np.float32]:
    """The photograph in linear light, blue first `[H, W, 3]`, with what lies outside its field reflected into it."""
    data = np.frombuffer(resources.files("conespot.render").joinpath("data/retina.jpg").read_bytes(), np.uint8)
    photo = cv2.imdecode(data, cv2.IMREAD_COLOR)
    if photo is None:
        raise RuntimeError("render/data/retina.jpg cannot be decoded: the installation is damaged")
    linear = srgb.decoded(photo.astype(np.float32) / np.float32(255.0))
    height, width = photo.shape[:2]
    x, y = np.meshgrid(np.arange(width) + 0.5, np.arange(height) + 0.5)
    return np.asarray(cv2.remap(linear, *_reflected(x, y), cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE))


def _reflected(x: NDArray[np.float64], y: NDArray[np.float64]) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """OpenCV's sampling positions of photograph positions, folded back into the field at its rim."""
    centre_x, centre_y, radius = PHOTO.field
    dx, dy = x - centre_x, y - centre_y
    rho = np.maximum(np.hypot(dx, dy), 1e-9)
    folded = radius - np.abs(np.mod(rho, 2.0 * radius) - radius)
    scale = folded / rho
    return (centre_x + dx * scale - 0.5).astype(np.float32), (centre_y + dy * scale - 0.5).astype(np.float32)


def _onto(photo: NDArray[np.float32], texel: float, *, fade: bool = False) -> Map:
    """A map in the photograph's pixels on the texels of a fundus map; `fade`: to 0 outside the field, not reflected."""
    x, y = texel_centres(texel)
    x, y = PHOTO.fovea[0] + x / PHOTO.texel, PHOTO.fovea[1] - y / PHOTO.texel
    finer = texel > PHOTO.texel
    blurred = cv2.GaussianBlur(photo, (0, 0), PHOTO.antialias * texel / PHOTO.texel) if finer else photo
    how = cv2.INTER_LINEAR if finer else cv2.INTER_CUBIC
    sampled = cv2.remap(blurred, *_reflected(x, y), how, borderMode=cv2.BORDER_REPLICATE)
    values = np.maximum(sampled, blurred.min())
    if fade:
        rho = np.hypot(x - PHOTO.field[0], y - PHOTO.field[1])
        values *= np.clip((PHOTO.field[2] - rho) / PHOTO.fade, 0.0, 1.0)
    return np.asarray(values, np.float32)


def _background(density: NDArray[np.float32], excluded: NDArray[np.uint8], sigma: float) -> NDArray[np.float32]:
    """The density around the vessels: a blur that leaves out the excluded pixels."""
    keep = 1.0 - excluded.astype(np.float32)
    norm = cv2.GaussianBlur(keep, (0, 0), sigma)
    return np.asarray(cv2.GaussianBlur(density * keep, (0, 0), sigma) / np.maximum(norm, 1e-3))


def _wide_blur(values: NDArray[Any], sigma: float) -> NDArray[np.float32]:
    """A Gaussian blur of many pixels, on an eighth of the size."""
    small = cv2.resize(values, None, fx=0.125, fy=0.125, interpolation=cv2.INTER_AREA)
    blurred = cv2.GaussianBlur(small, (0, 0), sigma / 8.0)
    return np.asarray(cv2.resize(blurred, values.shape[::-1], interpolation=cv2.INTER_LINEAR))


def _dark_ridges(density: NDArray[np.float32]) -> NDArray[np.float32]:
    """Strength of dark ridges: the largest over the scales of minus the smaller Hessian eigenvalue, where line-like."""
    strongest = np.zeros_like(density)
    for sigma in PHOTO.scales:
        blurred = cv2.GaussianBlur(density, (0, 0), sigma)
        xx = cv2.Sobel(blurred, cv2.CV_32F, 2, 0, ksize=3) / 4.0
        yy = cv2.Sobel(blurred, cv2.CV_32F, 0, 2, ksize=3) / 4.0
        xy = cv2.Sobel(blurred, cv2.CV_32F, 1, 1, ksize=3) / 4.0
        mean, spread = (xx + yy) / 2.0, np.sqrt(((xx - yy) / 2.0) ** 2 + xy**2)
        across, along = mean - spread, mean + spread
        line = np.clip(1.0 - np.abs(along) / np.maximum(np.abs(across), 1e-9), 0.0, 1.0)
        strongest = np.maximum(strongest, np.maximum(-across, 0.0) * line * sigma**PHOTO.scale_exponent)
    return strongest


def _vessel_mask(vesselness: NDArray[np.float32]) -> NDArray[np.uint8]:
    """Ridges above a low threshold that touch a high one and are long enough to be vessels."""
    field = np.zeros(vesselness.shape, np.uint8)
    cv2.circle(field, (round(PHOTO.field[0]), round(PHOTO.field[1])), round(PHOTO.field[2]), 1, -1)
    inside = vesselness[field > 0]
    low, high = np.percentile(inside, [PHOTO.weak, PHOTO.strong])
    candidates = ((vesselness > low) & (field > 0)).astype(np.uint8)
    _, labels, stats, _ = cv2.connectedComponentsWithStats(candidates, connectivity=8)
    strong = np.zeros(len(stats), bool)
    strong[np.unique(labels[vesselness > high])] = True
    length = np.maximum(stats[:, cv2.CC_STAT_WIDTH], stats[:, cv2.CC_STAT_HEIGHT])
    keep = strong & (length > PHOTO.longest_speck) & (stats[:, cv2.CC_STAT_AREA] > PHOTO.largest_speck)
    keep[0] = False
    return keep[labels].astype(np.uint8)


def _venous(green: NDArray[np.float32], red: NDArray[np.float32], mask: NDArray[np.uint8]) -> NDArray[np.float32]:
    """How venous a vessel is, 0 to 1: reduced haemoglobin absorbs red, so veins stay dark where arteries fade.

    The ratio of the densities in red and green, averaged along the vessels, against the mean of the thick vessels
    around: a rule of thumb.
    """
    sigma, wide = PHOTO.along, PHOTO.around * PHOTO.along
    weight = mask * np.maximum(green, 0.0)
    ratio = cv2.GaussianBlur(mask * red, (0, 0), sigma) / np.maximum(cv2.GaussianBlur(weight, (0, 0), sigma), 1e-3)
    thick = ((mask > 0) & (green > np.percentile(green[mask > 0], PHOTO.thick))).astype(np.float32)
    middle = _wide_blur(thick * ratio, wide) / np.maximum(_wide_blur(thick, wide), 1e-6)
    spread = float(np.std((ratio - middle)[thick > 0]))
    return np.asarray(1.0 / (1.0 + np.exp(-PHOTO.steepness * (ratio - middle) / max(spread, 1e-6))), np.float32)


def _paths(excess: NDArray[np.float32], saturation: float, deepest: float) -> NDArray[np.float32]:
    """Blood paths [um] whose densities at 550 nm are in the photograph's ratio, the darkest vessels `deepest` deep."""
    reference = float(np.percentile(excess[excess > PHOTO.least_excess], PHOTO.darkest_vessels))
    densest = float(fundus.vessel_density(550.0, saturation, deepest))
    transmission = np.power(10.0, -np.clip(excess / reference, 0.0, PHOTO.most_density) * densest)
    depth = fundus.vessel_depth(transmission, 550.0, saturation)
    return np.asarray(np.minimum(depth, PHOTO.most_path * deepest), np.float32)


def _disc_mask() -> NDArray[np.float32]:
    x, y = np.meshgrid(np.arange(PHOTO.side) + 0.5, np.arange(PHOTO.side) + 0.5)
    radius = np.hypot((x - PHOTO.disc[0]) / PHOTO.disc[2], (y - PHOTO.disc[1]) / PHOTO.disc[3])
    return np.asarray(1.0 / (1.0 + np.exp((radius - 1.0) / PHOTO.disc_rim)), np.float32)


def _pigment(
    green: NDArray[np.float32], red: NDArray[np.float32], excluded: NDArray[np.uint8]
) -> tuple[NDArray[np.float32], ...]:
    """Relative changes of melanin, blood and the reflectance before them: densities of 0.1 to 1 mm, vessels left out.

    Red sees the melanin. Green at medium pigmentation hardly passes it: there the change is one of the epithelium's and
    nerve fibres' reflectance, and of what red does not share part is blood.
    """
    filled = [_background(d, excluded, PHOTO.fill) * excluded + d * (1 - excluded) for d in (green, red)]
    bands = [cv2.GaussianBlur(d, (0, 0), PHOTO.fine) - _wide_blur(d, PHOTO.coarse) for d in filled]
    per_melanin = PHOTO.melanin_density * fundus.SITES["perifovea"].melanin
    melanin = np.clip(bands[1] / per_melanin, -PHOTO.most_melanin, PHOTO.most_melanin)
    changed = PHOTO.blood_share * (bands[0] - bands[1]) / PHOTO.blood_density
    blood = np.clip(changed, -PHOTO.most_blood, PHOTO.most_blood)
    epithelium = np.clip(np.power(10.0, -bands[0]) - 1.0, -PHOTO.most_epithelium, PHOTO.most_epithelium)
    return melanin.astype(np.float32), blood.astype(np.float32), epithelium.astype(np.float32)
