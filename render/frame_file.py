"""Frames on disk: radiance as multi-channel EXR with its provenance, previews as PNG."""

from __future__ import annotations

import os
import secrets
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from conespot.render import spectral
from conespot.scene import InputError, Pose, Scene
from conespot.scene.atomic import write_atomically
from conespot.scene.document import dump
from conespot.scene.exr import read_exr
from conespot.scene.spectrum import Curve


def frame_header(scene: Scene, pose: Pose, power_w: float, versions: Mapping[str, str]) -> dict[str, str | float]:
    """What a frame's EXR header says: pose, power, wavelengths, response curves, versions and the scene."""
    apex, axis = pose.apex, pose.axis
    return {
        "conespot.unit": spectral.unit(scene),
        "conespot.apex_mm": " ".join(f"{c:.9g}" for c in apex),
        "conespot.axis": " ".join(f"{c:.9g}" for c in axis),
        "conespot.power_w": float(power_w),
        "conespot.power_convention": scene.power.convention,
        "conespot.wavelengths_nm": f"{scene.illumination.spectrum.low:g} {scene.illumination.spectrum.high:g}",
        "conespot.scene": dump(scene),
        **_curves(scene),
        **{f"conespot.version.{name}": version for name, version in versions.items()},
    }


def _curves(scene: Scene) -> dict[str, str]:
    """Name and spectral response of every channel, and the light's spectrum [1/nm], as `wavelength:value` pairs."""
    found = spectral.channels(scene, scene.illumination)
    curves = {f"response.{label}": c.response for label, c in zip(_labels(len(found)), found, strict=True)}
    curves["light"] = scene.illumination.spectrum
    names = {f"conespot.channel.{label}": c.name for label, c in zip(_labels(len(found)), found, strict=True)}
    return names | {f"conespot.{name}": _written(curve) for name, curve in curves.items()}


def _written(curve: Curve) -> str:
    """A curve at its own points, or where it has many, every 5 nm."""
    at = curve.wavelengths
    if len(at) > 64:
        inner = np.arange(np.ceil(curve.low / 5.0) * 5.0, curve.high, 5.0)
        at = np.unique([curve.low, *inner, curve.high])
    return " ".join(f"{w:g}:{v:.6g}" for w, v in zip(at, curve(at), strict=True))


def _labels(channels: int) -> list[str]:
    return ["Y"] if channels == 1 else [f"C{i}" for i in range(channels)]


def write_frame(path: Path, radiance: NDArray[np.float32], header: Mapping[str, str | float]) -> None:
    """Write radiance `[H, W, C]` as 32-bit EXR, one channel each: `Y` alone, else `C0`, `C1`, ...

    The file is whole or not there. Raises InputError if it cannot be written.
    """
    import OpenEXR

    names = _labels(radiance.shape[-1])
    channels = {name: np.ascontiguousarray(radiance[..., i]) for i, name in enumerate(names)}
    # OpenEXR writes to a path only, in bytes to one of any encoding, so the file is made beside its place and renamed
    temporary = path.with_name(f".{secrets.token_hex(4)}.exr")
    attributes: dict[str, object] = {"compression": OpenEXR.ZIP_COMPRESSION, "type": OpenEXR.scanlineimage, **header}
    try:
        with OpenEXR.File(attributes, channels) as file:
            file.write(os.fsencode(temporary))
        temporary.replace(path)
    except (OSError, RuntimeError) as error:
        temporary.unlink(missing_ok=True)
        raise InputError(f"{path}: cannot be written: {error}") from None


def read_frame(path: Path) -> tuple[NDArray[np.float32], dict[str, object]]:
    """Radiance `[H, W, C]` and the header of a frame, which may be a stranger's.

    Raises InputError if the file is no such frame, or claims a size that no camera has.
    """
    try:
        found, header = read_exr(path)
        names = ["Y"] if "Y" in found else [f"C{i}" for i in range(len(found))]
        radiance = np.stack([found[name] for name in names], axis=-1).astype(np.float32)
    except (ValueError, KeyError, TypeError, MemoryError) as error:
        raise InputError(f"{path}: cannot be read as a conespot frame: {error}") from None
    return radiance, header


def write_preview(path: Path, image: NDArray[Any], full_scale: int) -> None:
    """Write an image `[H, W]` or `[H, W, 3]` (RGB), whose white is `full_scale`, as an 8-bit PNG of at most 1000 px."""
    shown: NDArray[Any] = image.astype(np.float32) * (255.0 / full_scale)
    side = max(shown.shape[:2])
    if side > 1000:
        scale = 1000.0 / side
        shown = cv2.resize(shown, None, fx=scale, fy=scale, interpolation=cv2.INTER_AREA)
    ready, png = cv2.imencode(".png", np.rint(shown[..., ::-1] if shown.ndim == 3 else shown).astype(np.uint8))
    if not ready:
        raise InputError(f"{path}: the image cannot be encoded as PNG")
    write_atomically(path, png.tobytes())
