"""Exposure: radiance becomes the sensor's pixel values. Power enters here and nowhere else."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from conespot.render import readout as emva
from conespot.render.tile import Crop, Tile
from conespot.scene.emva import Emva
from conespot.scene.sensor import Linear, Sensor, Srgb8


def encode(radiance: NDArray[np.floating[Any]], sensor: Srgb8 | Linear) -> NDArray[np.uint8] | NDArray[np.uint16]:
    """Pixel values of radiances [W m-2 sr-1], any shape: clipped at white, transferred, rounded to whole numbers.

    `srgb8` follows IEC 61966-2-1; `linear` is proportional.
    """
    relative = np.clip(radiance / np.float32(sensor.white), 0.0, 1.0)
    if isinstance(sensor, Srgb8):
        low = 12.92 * relative
        relative = np.where(relative <= 0.0031308, low, 1.055 * relative ** np.float32(1.0 / 2.4) - 0.055)
    values = np.floor(relative * sensor.full_scale + 0.5)
    return values.astype(np.uint8) if sensor.full_scale <= 255 else values.astype(np.uint16)


class Exposure:
    """Exposes frames over one background `[H, W, C]`, in W m-2 sr-1, or A m-2 sr-1 for an EMVA 1288 camera.

    Without noise only what the tiles touch is computed anew; a noisy frame is new everywhere.
    """

    def __init__(self, background: NDArray[np.float32], sensor: Sensor) -> None:
        self._background = background
        self.sensor = sensor
        if not isinstance(sensor, Emva):
            self._encoded = np.concatenate([encode(band, sensor) for band in np.array_split(background, 16)])

    def frame(self, tiles: Sequence[Tile], power_w: float, seed: int = 0) -> NDArray[np.uint8] | NDArray[np.uint16]:
        """The image `[H, W]`, or `[H, W, C]` of several channels, with every spotlight at `power_w` [W].

        `seed` decides the noise of an EMVA 1288 camera; a Bayer camera's raw frame is interpolated to three channels.
        """
        lit = [tile for tile in tiles if tile.radiance.size]
        if isinstance(self.sensor, Emva):
            return self._noisy(self.sensor, lit, power_w, seed)
        image = self._encoded.copy()
        if lit:
            crop, radiance = self._lit(lit, power_w)
            image[crop.slices] = encode(radiance, self.sensor)
        return image[..., 0] if image.shape[-1] == 1 else image

    def dark(self, tiles: Sequence[Tile], power_w: float, seed: int = 0) -> NDArray[np.uint8] | NDArray[np.uint16]:
        """The image without spotlights, at the exposure of the frame with these tiles at `power_w` [W]."""
        if not isinstance(self.sensor, Emva):
            return self.frame((), 0.0)
        lit = [tile for tile in tiles if tile.radiance.size]
        return self._digital(self._metered(self.sensor, lit, power_w), self._background, seed)

    @property
    def meters_once(self) -> bool:
        """Whether the exposure time is still to be set, once and from the campaign's brightest frame, by `metered`."""
        metering = self.sensor.metering if isinstance(self.sensor, Emva) else None
        return metering is not None and metering.each == "campaign"

    def metered(self, tiles: Sequence[Tile], power_w: float) -> Sensor:
        """The sensor with the exposure time that its metering asks for in this frame, and keeps; else as it is."""
        lit = [tile for tile in tiles if tile.radiance.size]
        if not isinstance(self.sensor, Emva) or self.sensor.metering is None or not lit:
            return self.sensor
        _, signal = self._lit(lit, power_w)
        reached = merged(lit)[1].max(axis=-1) > 0.0
        time = emva.metered_time(signal[reached], self.sensor)
        return self.sensor.model_copy(update={"exposure_time": time})

    def _lit(self, tiles: Sequence[Tile], power_w: float) -> tuple[Crop, NDArray[np.float32]]:
        crop, total = merged(tiles)
        return crop, self._background[crop.slices] + np.float32(power_w) * total

    def _noisy(
        self, sensor: Emva, lit: Sequence[Tile], power_w: float, seed: int
    ) -> NDArray[np.uint8] | NDArray[np.uint16]:
        signal = self._background
        if lit:
            crop, radiance = self._lit(lit, power_w)
            signal = signal.copy()
            signal[crop.slices] = radiance
        return self._digital(self._metered(sensor, lit, power_w), signal, seed)

    def _metered(self, sensor: Emva, lit: Sequence[Tile], power_w: float) -> Emva:
        if sensor.metering is None or sensor.metering.each != "frame":
            return sensor
        metered = self.metered(lit, power_w)
        assert isinstance(metered, Emva)
        return metered

    @staticmethod
    def _digital(sensor: Emva, signal: NDArray[np.float32], seed: int) -> NDArray[np.uint8] | NDArray[np.uint16]:
        raw = emva.expose(signal, sensor, seed)
        return emva.demosaic(raw) if signal.shape[-1] == 3 else raw


def merged(tiles: Sequence[Tile]) -> tuple[Crop, NDArray[np.float32]]:
    """The tiles' sum `[h, w, C]` over the crop that holds them all."""
    row = min(t.crop.row for t in tiles)
    column = min(t.crop.column for t in tiles)
    height = max(t.crop.row + t.crop.height for t in tiles) - row
    width = max(t.crop.column + t.crop.width for t in tiles) - column
    total = np.zeros((height, width, tiles[0].radiance.shape[-1]), np.float32)
    for tile in tiles:
        rows = slice(tile.crop.row - row, tile.crop.row - row + tile.crop.height)
        columns = slice(tile.crop.column - column, tile.crop.column - column + tile.crop.width)
        total[rows, columns] += tile.radiance
    return Crop(row, column, height, width), total
