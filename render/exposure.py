"""Exposure: radiance becomes the sensor's pixel values. Power enters here and nowhere else."""

from __future__ import annotations

import contextlib
import functools
from collections.abc import Iterator, Sequence
from typing import Any, assert_never

import numpy as np
from numpy.typing import NDArray

from conespot.render import readout as emva
from conespot.render import recording
from conespot.render.tile import Crop, Tile
from conespot.scene import srgb
from conespot.scene.emva import Emva
from conespot.scene.sensor import Linear, Recorded, Sensor, Srgb8

#: of the table of sRGB values, fine enough that few hold two of them
_BINS = 2**16
#: in place of a value
_UNKNOWN = 256
#: pixels worked on at once: what comes between stays in a processor's second cache
_AT_ONCE = 2**15

Pixels = NDArray[np.uint8] | NDArray[np.uint16]


def encode(radiance: NDArray[np.floating[Any]], sensor: Srgb8 | Linear) -> Pixels:
    """Pixel values of radiances [W m-2 sr-1], any shape: clipped at white, transferred, rounded to whole numbers.

    `srgb8` follows IEC 61966-2-1; `linear` is proportional.
    """
    flat = radiance.reshape(-1)
    values = np.empty(flat.shape, np.uint8 if sensor.full_scale <= 255 else np.uint16)
    for first in range(0, len(flat), _AT_ONCE):
        part = slice(first, first + _AT_ONCE)
        relative = np.clip(flat[part] / np.float32(sensor.white), 0.0, 1.0)
        match sensor:
            case Srgb8():
                values[part] = _srgb8(np.asarray(relative, np.float32))
            case Linear():
                values[part] = np.floor(relative * sensor.full_scale + 0.5)
            case unknown:
                assert_never(unknown)
    return values.reshape(radiance.shape)


def _srgb8(relative: NDArray[np.float32]) -> NDArray[np.uint8]:
    """Values `[N]` of relative radiances 0 to 1: looked up, and worked out where a bin may hold two of them."""
    found = np.take(_srgb8_table(), (relative * np.float32(_BINS)).astype(np.intp))
    values = found.astype(np.uint8)
    rest = np.flatnonzero(found == _UNKNOWN)
    values[rest] = _rounded(relative[rest])
    return values


@functools.cache
def _srgb8_table() -> NDArray[np.uint16]:
    """The value in each of `_BINS` bins and of white, `_UNKNOWN` where the bin or a neighbour holds another."""
    low = _rounded(np.arange(_BINS + 1, dtype=np.float32) / np.float32(_BINS))
    padded = np.pad(low, (1, 2), mode="edge")
    return np.where((padded[:-3] == low) & (padded[3:] == low), low, np.uint16(_UNKNOWN))


def _rounded(relative: NDArray[np.float32]) -> NDArray[np.uint8]:
    return np.floor(srgb.encoded(relative) * np.float32(255.0) + np.float32(0.5)).astype(np.uint8)


class Exposure:
    """Exposes frames over one background `[H, W, C]`, in W m-2 sr-1, or A m-2 sr-1 for an EMVA 1288 camera.

    Without noise only what the tiles touch is computed anew; a noisy frame is new everywhere.
    """

    def __init__(self, background: NDArray[np.float32], sensor: Sensor) -> None:
        self._background = background
        self.sensor = sensor
        self._recorder = sensor if isinstance(sensor, Recorded) else None
        self._camera = sensor.camera
        match self._camera:
            case Srgb8() | Linear() as plain:
                self._encoded = encode(background, plain)
                self._canvas: Pixels | None = None  #: a copy of it, to paint on
            case Emva():
                pass
            case unknown:
                assert_never(unknown)

    def frame(self, tiles: Sequence[Tile], power_w: float, seed: int = 0) -> Pixels:
        """The image `[H, W]`, or `[H, W, C]` of several channels, with every spotlight at `power_w` [W].

        `seed` decides the noise of an EMVA 1288 camera; a Bayer camera's raw frame is interpolated to three channels.
        """
        lit = _lit(tiles)
        match self._camera:
            case Emva() as camera:
                return self._kept(self._noisy(camera, lit, power_w, seed))
            case Srgb8() | Linear() as sensor:
                image = self._encoded.copy()
                if lit is not None:
                    crop, radiance = self._seen(lit, power_w)
                    image[crop.slices] = encode(radiance, sensor)
                return self._kept(image[..., 0] if image.shape[-1] == 1 else image)
            case unknown:
                assert_never(unknown)

    def _kept(self, image: Pixels) -> Pixels:
        """The image as the recorder leaves it, where there is one."""
        return image if self._recorder is None else recording.recorded(image, self._recorder)

    @contextlib.contextmanager
    def shown(self, tiles: Sequence[Tile], power_w: float, seed: int = 0) -> Iterator[Pixels]:
        """The image that `frame` gives, to look at while the context lasts: read-only, and gone afterwards.

        Without noise no frame is copied: what the tiles touch is exposed, and taken back.
        """
        lit = _lit(tiles)
        match self._camera:
            case Emva() as camera:
                yield self._kept(self._noisy(camera, lit, power_w, seed))
            case Srgb8() | Linear() as sensor:
                # whoever looks at a second frame meanwhile gets a canvas of its own
                canvas = self._encoded.copy() if self._canvas is None else self._canvas
                self._canvas, touched = None, []
                try:
                    if lit is not None:
                        crop, radiance = self._seen(lit, power_w)
                        touched.append(crop.slices)
                        canvas[crop.slices] = encode(radiance, sensor)
                    image = canvas[..., 0] if canvas.shape[-1] == 1 else canvas[:]
                    image.flags.writeable = False
                    yield self._kept(image)
                finally:
                    for where in touched:
                        canvas[where] = self._encoded[where]
                    self._canvas = canvas
            case unknown:
                assert_never(unknown)

    def dark(self, tiles: Sequence[Tile], power_w: float, seed: int = 0) -> Pixels:
        """The image without spotlights, at the exposure of the frame with these tiles at `power_w` [W]."""
        match self._camera:
            case Emva() as camera:
                lit = _lit(tiles)
                return self._kept(self._digital(self._for_frame(camera, lit, power_w), self._background, seed))
            case Srgb8() | Linear():
                return self.frame((), 0.0)
            case unknown:
                assert_never(unknown)

    @property
    def meters_once(self) -> bool:
        """Whether the exposure time is still to be set, once and from the campaign's brightest frame, by `metered`."""
        metering = self.sensor.metering
        return metering is not None and metering.each == "campaign"

    def metered(self, tiles: Sequence[Tile], power_w: float) -> Sensor:
        """The sensor with the exposure time that its metering asks for in this frame, and keeps; else as it is."""
        match self._camera:
            case Emva() as camera:
                timed = self._metered(camera, _lit(tiles), power_w)
                return timed if self._recorder is None else self._recorder.model_copy(update={"camera": timed})
            case Srgb8() | Linear():
                return self.sensor
            case unknown:
                assert_never(unknown)

    def _seen(self, tile: Tile, power_w: float) -> tuple[Crop, NDArray[np.float32]]:
        """What a tile changes of the frame, and its radiance: all of it where there is glare."""
        if tile.glare is None:
            return tile.crop, self._background[tile.crop.slices] + np.float32(power_w) * tile.radiance
        radiance = self._background + np.float32(power_w) * tile.glare
        radiance[tile.crop.slices] += np.float32(power_w) * tile.radiance
        return Crop.whole(radiance.shape[:2]), radiance

    def _noisy(self, camera: Emva, lit: Tile | None, power_w: float, seed: int) -> Pixels:
        signal = self._background
        if lit is not None:
            crop, radiance = self._seen(lit, power_w)
            signal = signal.copy()
            signal[crop.slices] = radiance
        return self._digital(self._for_frame(camera, lit, power_w), signal, seed)

    def _metered(self, camera: Emva, lit: Tile | None, power_w: float) -> Emva:
        if camera.metering is None or lit is None:
            return camera
        crop, signal = self._seen(lit, power_w)
        reached = lit.radiance.max(axis=-1) > 0.0
        signal = signal[lit.crop.within(crop)][reached]
        return camera.model_copy(update={"exposure_time": emva.metered_time(signal, camera)})

    def _for_frame(self, camera: Emva, lit: Tile | None, power_w: float) -> Emva:
        """The camera as it takes one frame: metered anew where it does that for each."""
        anew = camera.metering is not None and camera.metering.each == "frame"
        return self._metered(camera, lit, power_w) if anew else camera

    @staticmethod
    def _digital(camera: Emva, signal: NDArray[np.float32], seed: int) -> Pixels:
        raw = emva.expose(signal, camera, seed)
        return emva.demosaic(raw) if signal.shape[-1] == 3 else raw


def _lit(tiles: Sequence[Tile]) -> Tile | None:
    """The tiles' sum; None if they are empty."""
    lit = [tile for tile in tiles if tile.radiance.size]
    return merged(lit) if lit else None


def merged(tiles: Sequence[Tile]) -> Tile:
    """The tiles' sum, over the crop that holds them all."""
    if len(tiles) == 1:
        return tiles[0]
    row = min(t.crop.row for t in tiles)
    column = min(t.crop.column for t in tiles)
    height = max(t.crop.row + t.crop.height for t in tiles) - row
    width = max(t.crop.column + t.crop.width for t in tiles) - column
    total = np.zeros((height, width, tiles[0].radiance.shape[-1]), np.float32)
    for tile in tiles:
        rows = slice(tile.crop.row - row, tile.crop.row - row + tile.crop.height)
        columns = slice(tile.crop.column - column, tile.crop.column - column + tile.crop.width)
        total[rows, columns] += tile.radiance
    glares = [tile.glare for tile in tiles if tile.glare is not None]
    return Tile(Crop(row, column, height, width), total, np.sum(glares, axis=0) if glares else None)
