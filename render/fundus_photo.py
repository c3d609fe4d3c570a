"""Vessels, pigment and disc from the fundus photograph (M. Haggstrom, CC0; render/data/retina.jpg).

The photograph is a camera's picture: its patterns are used, never its brightness.
"""

from __future__ import annotations

import functools
from importlib import resources
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from conespot.render.fundus_anatomy import COARSE, FINE, Anatomy, Map, texel_centres
from conespot.scene import fundus, srgb

#: side of a photograph's texel [mm], centre of its round field and of the fovea (x, y), and radius of the field [px]
TEXEL = 0.01
_FIELD = (705.0, 705.0, 680.0)
_FOVEA = (706.0, 697.0)
#: optic disc: centre (x, y) and semi-axes [px], read off the photograph
_DISC = (218.0, 645.0, 97.0, 112.0)
#: scales of the vessels sought, standard deviations [px]
_SCALES = (1.4, 2.0, 3.0, 4.5, 6.5)


def disc_centre() -> tuple[float, float]:
    """Arc coordinates of the disc's centre [mm], fovea at the origin."""
    return (_DISC[0] - _FOVEA[0]) * TEXEL, -(_DISC[1] - _FOVEA[1]) * TEXEL


@functools.cache
def photographed() -> Anatomy:
    """The photograph's pattern, continued beyond its field by reflection."""
    linear = _linear_photo()
    density = -np.log10(np.maximum(linear, 1e-3))  # [H, W, 3], blue first
    green, red = density[..., 1], density[..., 2]
    vesselness = _dark_ridges(green)
    mask = _vessel_mask(vesselness)
    wide = cv2.dilate(mask, cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (7, 7))).astype(np.uint8)
    green_excess = green - _background(green, wide)
    red_excess = red - _background(red, wide)
    soft = cv2.GaussianBlur(mask.astype(np.float32), (0, 0), 0.7)
    weight = np.clip(2.0 * soft, 0.0, 1.0) * np.maximum(green_excess, 0.0)
    venous = _venous(green_excess, red_excess, mask)
    artery, vein = (_paths(weight * share, saturation, depth) for share, saturation, depth in (
        (1.0 - venous, fundus.ARTERY_SATURATION, fundus.ARTERY_DEPTH),
        (venous, fundus.VEIN_SATURATION, fundus.VEIN_DEPTH),
    ))  # fmt: skip
    disc = _disc_mask()
    melanin, blood, epithelium = _pigment(green, red, np.maximum(wide, (disc > 0.02).astype(np.uint8)))
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
    dx, dy = x - _FIELD[0], y - _FIELD[1]
    rho = np.maximum(np.hypot(dx, dy), 1e-9)
    folded = _FIELD[2] - np.abs(np.mod(rho, 2.0 * _FIELD[2]) - _FIELD[2])
    scale = folded / rho
    return (_FIELD[0] + dx * scale - 0.5).astype(np.float32), (_FIELD[1] + dy * scale - 0.5).astype(np.float32)


def _onto(photo: NDArray[np.float32], texel: float, *, fade: bool = False) -> Map:
    """A map in the photograph's pixels on the texels of a fundus map; `fade`: to 0 outside the field, not reflected."""
    x, y = texel_centres(texel)
    at = _reflected(_FOVEA[0] + x / TEXEL, _FOVEA[1] - y / TEXEL)
    blurred = cv2.GaussianBlur(photo, (0, 0), 0.4 * texel / TEXEL) if texel > TEXEL else photo
    how = cv2.INTER_LINEAR if texel > TEXEL else cv2.INTER_CUBIC
    values = np.maximum(cv2.remap(blurred, *at, how, borderMode=cv2.BORDER_REPLICATE), blurred.min())
    if fade:
        rho = np.hypot(_FOVEA[0] + x / TEXEL - _FIELD[0], _FOVEA[1] - y / TEXEL - _FIELD[1])
        values *= np.clip((_FIELD[2] - rho) / 20.0, 0.0, 1.0)
    return np.asarray(values, np.float32)


def _background(density: NDArray[np.float32], excluded: NDArray[np.uint8], sigma: float = 14.0) -> NDArray[np.float32]:
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
    for sigma in _SCALES:
        blurred = cv2.GaussianBlur(density, (0, 0), sigma)
        xx = cv2.Sobel(blurred, cv2.CV_32F, 2, 0, ksize=3) / 4.0
        yy = cv2.Sobel(blurred, cv2.CV_32F, 0, 2, ksize=3) / 4.0
        xy = cv2.Sobel(blurred, cv2.CV_32F, 1, 1, ksize=3) / 4.0
        mean, spread = (xx + yy) / 2.0, np.sqrt(((xx - yy) / 2.0) ** 2 + xy**2)
        across, along = mean - spread, mean + spread
        line = np.clip(1.0 - np.abs(along) / np.maximum(np.abs(across), 1e-9), 0.0, 1.0)
        strongest = np.maximum(strongest, np.maximum(-across, 0.0) * line * sigma**1.5)
    return strongest


def _vessel_mask(vesselness: NDArray[np.float32]) -> NDArray[np.uint8]:
    """Ridges above a low threshold that touch a high one and are long enough to be vessels."""
    field = np.zeros(vesselness.shape, np.uint8)
    cv2.circle(field, (round(_FIELD[0]), round(_FIELD[1])), round(_FIELD[2]), 1, -1)
    inside = vesselness[field > 0]
    low, high = np.percentile(inside, [87.0, 95.0])
    candidates = ((vesselness > low) & (field > 0)).astype(np.uint8)
    _, labels, stats, _ = cv2.connectedComponentsWithStats(candidates, connectivity=8)
    strong = np.zeros(len(stats), bool)
    strong[np.unique(labels[vesselness > high])] = True
    length = np.maximum(stats[:, cv2.CC_STAT_WIDTH], stats[:, cv2.CC_STAT_HEIGHT])
    keep = strong & (length > 30) & (stats[:, cv2.CC_STAT_AREA] > 90)
    keep[0] = False
    return keep[labels].astype(np.uint8)


def _venous(
    green: NDArray[np.float32], red: NDArray[np.float32], mask: NDArray[np.uint8], sigma: float = 12.0
) -> NDArray[np.float32]:
    """How venous a vessel is, 0 to 1: reduced haemoglobin absorbs red, so veins stay dark where arteries fade.

    The ratio of the densities in red and green, averaged along the vessels, against the mean of the thick vessels
    around: a rule of thumb.
    """
    weight = mask * np.maximum(green, 0.0)
    ratio = cv2.GaussianBlur(mask * red, (0, 0), sigma) / np.maximum(cv2.GaussianBlur(weight, (0, 0), sigma), 1e-3)
    thick = ((mask > 0) & (green > np.percentile(green[mask > 0], 60.0))).astype(np.float32)
    middle = _wide_blur(thick * ratio, 10.0 * sigma) / np.maximum(_wide_blur(thick, 10.0 * sigma), 1e-6)
    spread = float(np.std((ratio - middle)[thick > 0]))
    return np.asarray(1.0 / (1.0 + np.exp(-4.0 * (ratio - middle) / max(spread, 1e-6))), np.float32)


def _paths(excess: NDArray[np.float32], saturation: float, deepest: float) -> NDArray[np.float32]:
    """Blood paths [um] whose densities at 550 nm are in the photograph's ratio, the darkest vessels `deepest` deep."""
    reference = float(np.percentile(excess[excess > 0.02], 97.0))
    densest = float(fundus.vessel_density(550.0, saturation, deepest))
    transmission = np.power(10.0, -np.clip(excess / reference, 0.0, 1.05) * densest)
    return np.asarray(np.minimum(fundus.vessel_depth(transmission, 550.0, saturation), 1.5 * deepest), np.float32)


def _disc_mask() -> NDArray[np.float32]:
    x, y = np.meshgrid(np.arange(1411) + 0.5, np.arange(1411) + 0.5)
    radius = np.hypot((x - _DISC[0]) / _DISC[2], (y - _DISC[1]) / _DISC[3])
    return np.asarray(1.0 / (1.0 + np.exp((radius - 1.0) / 0.03)), np.float32)


def _pigment(
    green: NDArray[np.float32], red: NDArray[np.float32], excluded: NDArray[np.uint8]
) -> tuple[NDArray[np.float32], ...]:
    """Relative changes of melanin, blood and the reflectance before them: densities of 0.1 to 1 mm, vessels left out.

    Red sees the melanin, 0.8 of density per unit at 650 nm. Green at medium pigmentation hardly passes it: there the
    change is one of the epithelium's and nerve fibres' reflectance, and what red does not share is blood (0.25 of
    density per relative change at 550 nm, half of it).
    """
    filled = [_background(d, excluded, 5.0) * excluded + d * (1 - excluded) for d in (green, red)]
    bands = [cv2.GaussianBlur(d, (0, 0), 3.0) - _wide_blur(d, 90.0) for d in filled]
    melanin = np.clip(bands[1] / (0.8 * fundus.SITES["perifovea"].melanin), -0.25, 0.25)
    blood = np.clip(0.5 * (bands[0] - bands[1]) / 0.25, -0.35, 0.35)
    epithelium = np.clip(np.power(10.0, -bands[0]) - 1.0, -0.3, 0.3)
    return melanin.astype(np.float32), blood.astype(np.float32), epithelium.astype(np.float32)
