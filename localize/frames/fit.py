"""Whether a stored picture is a frame of the scene's sensor; if not, it is refused with the key that would mend it."""

from __future__ import annotations

import numpy as np

from conespot.localize.frames.stored import Pixels, Stored, Turn, check_size
from conespot.localize.image import AnyImage
from conespot.scene import srgb
from conespot.scene.document import InputError
from conespot.scene.emva import Emva
from conespot.scene.scene import Scene
from conespot.scene.sensor import SENSORS, AnySensor, Linear, Recorded, Srgb8

_CHANNELS = ("red", "green", "blue")


def fitted(name: str, stored: Stored, scene: Scene) -> AnyImage:
    """The frame `[H, W]` or `[H, W, 3]` that `locate` takes: upright, in the sensor's channels and its own values.

    uint8 or uint16 whose largest value is the sensor's, or float whose 1 is. Raises InputError for a picture that does
    not fit: size, channels, transparency, bits, alignment, range, transfer; NaN.
    """
    turns = (stored.turn, Turn.stated(scene.storage))
    check_size(name, stored.pixels.shape[0], stored.pixels.shape[1], turns, scene)
    pixels = _channels(name, _opaque(name, stored.pixels), scene)
    _check_range(name, stored, scene)
    pixels = _lit(name, pixels, stored, scene) if pixels.dtype.kind == "f" else _whole(name, pixels, stored, scene)
    for turn in turns:
        pixels = turn.of(pixels)
    return np.ascontiguousarray(pixels)


def _opaque(name: str, pixels: Pixels) -> Pixels:
    """Without its alpha, which must say nothing."""
    if pixels.ndim == 2 or pixels.shape[2] == 3:
        return pixels
    full = 1.0 if pixels.dtype.kind == "f" else np.iinfo(pixels.dtype).max
    if not np.all(pixels[..., 3] == full):
        raise InputError(f"{name}: has transparent pixels, whose light nobody knows; save it without an alpha channel")
    return pixels[..., :3]


def _channels(name: str, pixels: Pixels, scene: Scene) -> Pixels:
    colours = scene.sensor.responses is not None and len(scene.sensor.responses) == 3
    if colours:
        if pixels.ndim == 2:
            raise InputError(
                f"{name}: is grey, but scene.sensor has three colours; write the camera's own kind as scene.sensor"
            )
        return pixels
    if pixels.ndim == 2:
        return pixels
    if scene.storage.channel is not None:
        return pixels[..., _CHANNELS.index(scene.storage.channel)]
    first = pixels[..., 0]
    if all(np.array_equal(first, pixels[..., k]) for k in (1, 2)):
        return first  # grey that was saved as colours
    raise InputError(
        f"{name}: is in colour, but scene.sensor is grey; write scene.sensor with colours (srgb8-colour,"
        " cmv12000-rgb), or scene.storage.channel: green (red, blue) to take one of them"
    )


def as_camera(sensor: AnySensor) -> str:
    """How a recorded sensor's scene names the camera that is now the whole sensor: by its name, or as it is written."""
    return sensor.kind if sensor.kind in SENSORS else f"{{kind: {sensor.kind}, and what else stands there now}}"


def _check_range(name: str, stored: Stored, scene: Scene) -> None:
    sensor = scene.sensor
    if isinstance(sensor, Recorded):
        if stored.span not in (None, sensor.range):
            raise InputError(f"{name}: says it is of {stored.span} range; write scene.sensor.range: {stored.span}")
        return
    if stored.span == "limited":
        raise InputError(
            f"{name}: says it is of limited range (black 16, white 235); write scene.sensor: {{kind: recorded, camera:"
            f" {as_camera(sensor)}, range: limited}}"
        )


def _whole(name: str, pixels: Pixels, stored: Stored, scene: Scene) -> Pixels:
    """Pixels of whole numbers as values of the sensor."""
    sensor = scene.sensor
    full, bits = sensor.full_scale, sensor.full_scale.bit_length()
    _check_transfer(name, stored, scene)
    if pixels.dtype == np.uint8:
        if full > 255:
            raise InputError(
                f"{name}: has 8 bits a pixel, but scene.sensor has {bits}; give frames with all of them, or write"
                " scene.sensor.bits: 8 if the camera gives no more"
            )
        return pixels
    most = int(pixels.max(initial=0))
    # bits that are set in no pixel; noise sets the lowest in half of a frame's
    low = int(np.bitwise_or.reduce(pixels, axis=None)) & (2 ** (16 - bits) - 1)
    if scene.storage.alignment == "left":
        shift = 16 - bits
        value = pixels >> shift
        if low and not _left_aligned(pixels, bits):
            raise InputError(
                f"{name}: its lower {shift} of 16 bits hold values of their own, so scene.sensor's {bits} bits are not"
                " left-aligned; write scene.storage.alignment: right, or scene.sensor.bits: 16"
            )
        return value.astype(np.uint8) if full == 255 else value
    if most > full:
        # of fewer bits in the upper ones no more than a copy of themselves stands below
        if most > 2 * full and _left_aligned(pixels, bits):
            hint = "write scene.storage.alignment: left, if they stand in the upper bits"
        elif isinstance(sensor, (Linear, Emva)):
            hint = f"write scene.sensor.bits: {most.bit_length()}, or what the camera has"
        else:
            hint = "write the camera's own kind as scene.sensor, or give frames of 8 bits"
        raise InputError(f"{name}: holds values up to {most}, but scene.sensor ends at {full} ({bits} bits); {hint}")
    if bits < 16 and most and not low:
        raise InputError(
            f"{name}: every value is a multiple of {2 ** (16 - bits)}, as where {bits} bits stand in the upper ones"
            " of 16; write scene.storage.alignment: left"
        )
    return pixels.astype(np.uint8) if full == 255 else pixels


def _left_aligned(pixels: Pixels, bits: int) -> bool:
    """Whether values of so many bits may stand in the upper ones of 16, with nothing of their own below."""
    value = pixels >> (16 - bits)
    shifted = value << (16 - bits)
    # who scales 12 bits to 16 writes their upper bits below them once more
    return np.array_equal(pixels, shifted) or np.array_equal(pixels, shifted | (value >> max(0, 2 * bits - 16)))


def _check_transfer(name: str, stored: Stored, scene: Scene) -> None:
    if stored.transfer is None or scene.storage.profile == "ignored":
        return
    curved = isinstance(scene.sensor, (Srgb8, Recorded))
    if stored.transfer == ("srgb" if curved else "linear"):
        return
    said = {"srgb": "sRGB", "linear": "linear", "other": "of a colour profile other than sRGB"}[stored.transfer]
    raise InputError(
        f"{name}: says its values are {said}, but scene.sensor ({scene.sensor.kind}) has"
        f" {'the sRGB transfer' if curved else 'a linear one'}; write that kind of scene.sensor, or"
        " scene.storage.profile: ignored if the file is mistaken"
    )


def _lit(name: str, pixels: Pixels, stored: Stored, scene: Scene) -> Pixels:
    """Float pixels as shares of the sensor's largest value."""
    if not np.isfinite(pixels).all():
        raise InputError(f"{name}: has pixels that are NaN or infinite; mask or repair them first")
    white = scene.storage.white
    most = float(pixels.max(initial=0.0))
    if stored.transfer is None:
        if white is None and most > 1.0:
            raise InputError(
                f"{name}: float pixels up to {most:g}, where 1 is white; write scene.storage.white: VALUE, the one that"
                " is"
            )
        return np.asarray(pixels, np.float32) / np.float32(white or 1.0)
    match scene.sensor:
        case Srgb8() | Linear() as sensor:
            white = white or (sensor.white if stored.radiance else 1.0)
            share = np.minimum(np.asarray(pixels, np.float32) / np.float32(white), np.float32(1.0))
            return srgb.encoded(share) if isinstance(sensor, Srgb8) else share
        case Emva() | Recorded() as sensor:
            raise InputError(
                f"{name}: holds light, not values of scene.sensor ({sensor.kind}), which has a black level and noise;"
                " write scene.sensor: {kind: linear, white: RADIANCE}, or give the camera's own frames"
            )
