"""The image a localizer is given: checked, and turned to light, or to eight bits of grey for those that threshold.

A signal of 1 is white: the largest value a pixel can take.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import cv2
import numpy as np
from numpy.typing import ArrayLike, NDArray

from conespot.scene import InputError, Scene
from conespot.scene.sensor import ImageSensor

AnyImage = NDArray[Any]  #: `[H, W]` or `[H, W, 3]` (RGB)
Signal = NDArray[np.float32]  #: light, 1 is white


def checked(image: ArrayLike, scene: Scene) -> AnyImage:
    """The image `[H, W]` or `[H, W, 3]` as an array that belongs to the scene's camera.

    Floats above 1.0 are as white as a pixel can be, and count as clipped.

    Raises InputError for another shape or data type, NaN or infinite pixels, a size other than the camera's, and
    values that the sensor does not have: above its full scale, or white at a multiple of a power of two below it.
    """
    array = np.asarray(image)
    kind_known = array.dtype in (np.uint8, np.uint16) or np.issubdtype(array.dtype, np.floating)
    if not kind_known:
        raise InputError(f"image: pixels of type {array.dtype} cannot be read; give uint8, uint16 or float")
    if not (array.ndim == 2 or (array.ndim == 3 and array.shape[2] == 3)):
        raise InputError(f"image: shape {array.shape} is neither [H, W] nor [H, W, 3]")
    if array.shape[:2] != scene.camera.shape:
        height, width = array.shape[:2]
        raise InputError(
            f"image: {width} x {height} px do not fit scene.camera.resolution = {scene.camera.size_words}; "
            "give the whole frame, or the scene of the camera that took it"
        )
    if array.dtype.kind == "f":
        if not np.isfinite(array).all():
            raise InputError("image: has pixels that are NaN or infinite; mask or repair them first")
        return np.minimum(array, 1.0) if float(array.max(initial=0.0)) > 1.0 else array
    elif array.dtype == np.uint16 or scene.sensor.full_scale < 255:
        _check_values(array, white_level(array, scene.sensor))
    return array


def _check_values(array: AnyImage, full: int) -> None:
    """Raises InputError for whole numbers that are not those of a sensor whose white is `full`."""
    most = int(array.max(initial=0))
    if most > full:
        raise InputError(
            f"image: values up to {most} do not fit scene.sensor, whose white is {full}; write its true bits, or shift"
            f" values that are left-aligned in 16 bits to the right (scene.storage: {{alignment: left}} for files)"
        )
    # white that is rounded down to a multiple of 2, 4, ... would not be known as clipped
    unit = (full + 1) - most
    if unit > 1 and unit & (unit - 1) == 0 and most > full // 2 and not int(np.bitwise_or.reduce(array, None)) % unit:
        bits = (full + 1).bit_length() - unit.bit_length()
        raise InputError(
            f"image: all values are multiples of {unit}, so that white is {most} and not scene.sensor's {full}; divide"
            f" them by {unit} and write scene.sensor.bits: {bits} (scene.storage: {{alignment: left}} for files)"
        )


@dataclass(frozen=True, eq=False)
class Frame:
    """A checked image and the sensor that took it: light, wherever a fit looks.

    A patch takes up little of a frame, so only what is looked at is decoded: all 25 Mpx would take longer than the fit.
    """

    pixels: AnyImage
    sensor: ImageSensor
    #: standard deviations of a compression's rounding by which white counts as white that was darkened
    ringing: float = 0.0

    @property
    def steps(self) -> int | None:
        """Steps from 0 to white in which its values are rounded; None for float pixels."""
        return None if self.pixels.dtype.kind == "f" else white_level(self.pixels, self.sensor)

    @property
    def side(self) -> int:
        """Pixels along the longer side."""
        return max(self.pixels.shape[:2])

    def light(self, rows: slice, columns: slice) -> tuple[Signal, NDArray[np.bool_]]:
        """Signals [white] of some pixels, and which of them are clipped and only bounds: `[h, w, C]` each."""
        seen = self._every_channel(rows, columns)
        return linear_light(seen, self.sensor, self.ringing)

    def signal(self, rows: slice, columns: slice) -> Signal:
        """The same without what is clipped."""
        return signals(self._every_channel(rows, columns), self.sensor)

    def at(self, row: NDArray[np.intp], column: NDArray[np.intp]) -> tuple[Signal, NDArray[np.bool_]]:
        """Signals [white] of single pixels, and which of them are clipped: `[N, C]` each."""
        seen = self.pixels[row, column]
        return linear_light(seen.reshape(len(row), -1), self.sensor, self.ringing)

    def _every_channel(self, rows: slice, columns: slice) -> AnyImage:
        """Pixel values `[h, w, C]`."""
        seen = np.ascontiguousarray(self.pixels[rows, columns])
        return seen.reshape(*seen.shape[:2], -1)


@dataclass(frozen=True, eq=False)
class Reference:
    """A view without spotlights: `pixels` `[H, W]` or `[H, W, 3]`, 1 is white, the mean of `frames` frames."""

    pixels: Signal
    frames: float = 1.0

    @classmethod
    def of(cls, reference: ArrayLike | Reference, scene: Scene) -> Reference:
        """A checked reference; a bare image counts as one frame. Raises InputError as `checked` does."""
        if isinstance(reference, Reference):
            return cls(np.asarray(checked(reference.pixels, scene), np.float32), reference.frames)
        image = checked(reference, scene)
        white = 1.0 if image.dtype.kind == "f" else white_level(image, scene.sensor)
        return cls(image.astype(np.float32) / np.float32(white))

    @classmethod
    def mean(cls, images: Iterable[AnyImage], scene: Scene) -> Reference:
        """The mean of several checked frames. Raises InputError for none."""
        total, count = None, 0
        for image in images:
            one = cls.of(image, scene).pixels
            total = one if total is None else total + one
            count += 1
        if total is None:
            raise InputError("reference: at least one frame is needed")
        return cls(total / np.float32(count), float(count))


def white_level(image: AnyImage, sensor: ImageSensor) -> int:
    """The largest value a pixel of an image of whole numbers can take."""
    return sensor.full_scale if image.dtype == np.uint16 else min(255, sensor.full_scale)


def linear_light(pixels: AnyImage, sensor: ImageSensor, ringing: float = 0.0) -> tuple[Signal, NDArray[np.bool_]]:
    """Signals [white] of pixel values of any shape, and which of them are clipped and only bounds.

    With `ringing` those are too that so many standard deviations of a compression's rounding may have darkened.

    uint8: 255 is white, or what fewer bits end at; uint16: the sensor's full scale; float: 1.0. Raises InputError for
    any other type.
    """
    signal, least = signals(pixels, sensor), sensor.clips_from - ringing * sensor.noise.compression / sensor.full_scale
    if pixels.dtype.kind == "f":
        return signal, pixels.astype(np.float32) >= least
    shares = _shares(white_level(pixels, sensor), pixels.dtype.itemsize)
    return signal, pixels >= int(np.searchsorted(shares, least))


def signals(pixels: AnyImage, sensor: ImageSensor) -> Signal:
    """Signals [white] of pixel values, as `linear_light` has them."""
    if pixels.dtype == np.uint8 or pixels.dtype == np.uint16:
        return _table(sensor, white_level(pixels, sensor), pixels.dtype.itemsize).take(pixels)
    if np.issubdtype(pixels.dtype, np.floating):
        return sensor.decode(pixels.astype(np.float32).astype(float)).astype(np.float32)
    raise InputError(f"an image must be uint8, uint16 or float, not {pixels.dtype}")


@lru_cache(maxsize=8)
def _table(sensor: ImageSensor, full: int, size: int) -> Signal:
    """Signal of every value that pixels of so many bytes can have."""
    return sensor.decode(_shares(full, size)).astype(np.float32)


@lru_cache(maxsize=8)
def _shares(full: int, size: int) -> NDArray[np.float64]:
    """Every value that pixels of so many bytes can have, over white."""
    return np.asarray(np.minimum(np.arange(256**size) / full, 1.0))


def grey8(image: AnyImage, scene: Scene) -> NDArray[np.uint8]:
    """The checked image as `[H, W]` grey values of 0 to 255, colours (RGB) weighted 0.299, 0.587, 0.114.

    White is 255 for uint8 and 1.0 for float; for uint16, and for sensors of less than eight bits, it is the
    sensor's full scale.
    """
    array = np.ascontiguousarray(image)
    if array.dtype.kind == "f":
        array = array.astype(np.float32, copy=False)
    if array.ndim == 3:
        array = cv2.cvtColor(array, cv2.COLOR_RGB2GRAY)
    if array.dtype.kind == "f":
        return _scaled(np.maximum(array, 0.0), 255.0)
    white = white_level(array, scene.sensor)
    if array.dtype == np.uint8 and white == 255:
        return np.asarray(array, np.uint8)
    return _scaled(array, 255.0 / white)


def _scaled(array: NDArray[Any], factor: float) -> NDArray[np.uint8]:
    return np.asarray(cv2.convertScaleAbs(array, alpha=factor), np.uint8)
