"""What the retina reflects: the one class that a renderer asks for albedo.

Maps lie in arc coordinates: `a = (a_x, a_y)` [mm] is the distance along the sphere from the posterior pole in the
direction of (x, y), so that a photograph keeps its scale everywhere (azimuthal equidistant projection).
"""

from __future__ import annotations

import functools
from importlib import resources
from types import ModuleType
from typing import TYPE_CHECKING, assert_never

import cv2
import numpy as np
from numpy.typing import NDArray

from conespot.render import spectral
from conespot.render.fundus_anatomy import EXTENT as MAP_EXTENT
from conespot.render.fundus_maps import fundus_maps
from conespot.render.fundus_texture import fundus_texture
from conespot.scene import srgb
from conespot.scene.retina import Fundus, FundusSite, PhotoRetina, Retina, UniformRetina
from conespot.scene.spectrum import Curve

if TYPE_CHECKING:
    from mitsuba import Texture

#: side of a texel [mm]: the photograph shows 14 mm on 1411 px
TEXEL = 0.01
#: half the side of the map [mm]
EXTENT = 12.0
#: refractive index of the vitreous in front of the retina
VITREOUS_INDEX = 1.336
#: centre (x, y) and radius [px] of the photograph's round field
_FIELD = (705.0, 705.0, 680.0)


class Reflectance:
    """Reflectance of the retina over its arc coordinates, grey or spectral."""

    def __init__(self, retina: Retina) -> None:
        self.retina = retina

    @property
    def is_spectral_map(self) -> bool:
        """Whether it varies with place and wavelength together, which only a JIT variant evaluates per wavelength."""
        return isinstance(self.retina, Fundus)

    @functools.cached_property
    def map(self) -> NDArray[np.float32]:
        """Grey albedo `[N, N]` of texels of `TEXEL` mm over +-`EXTENT` mm; rows run down (-y), columns right (+x).

        Raises TypeError for a spectral retina, which has none.
        """
        match self.retina:
            case UniformRetina(albedo=albedo):
                return np.full((2, 2), albedo, np.float32)
            case PhotoRetina() as photo:
                return _photo_map(photo)
            case FundusSite() | Fundus():
                raise TypeError("a spectral retina has no grey albedo")
            case unknown:
                assert_never(unknown)

    @property
    def is_grey(self) -> bool:
        """Whether all wavelengths are reflected alike."""
        return not self.retina.is_spectral

    @property
    def is_even(self) -> bool:
        """Whether it is the same everywhere."""
        return isinstance(self.retina, (UniformRetina, FundusSite))

    def bsdf(self, mi: ModuleType, texture: Texture | dict[str, object]) -> dict[str, object]:
        """The Mitsuba BSDF: Lambertian, under a dielectric coat where the retina has a glint."""
        glint = self.retina.glint if isinstance(self.retina, Fundus) else None
        if glint is None:
            return {"type": "diffuse", "reflectance": texture}
        coat = {"int_ior": glint.index, "ext_ior": VITREOUS_INDEX, "alpha": glint.roughness, "distribution": "ggx"}
        return {"type": "roughplastic", "diffuse_reflectance": texture, **coat}

    def texture(self, mi: ModuleType, dr: ModuleType, band: Curve | None = None) -> Texture | dict[str, object]:
        """The Mitsuba texture, over the texture coordinates that `texture_coordinates` gives.

        Of a fundus that spreads light it has the local part alone, what comes back where it falls. `band`: for the
        scalar variant, the weight over which a spectral map is averaged.
        """
        match self.retina:
            case UniformRetina(albedo=albedo):
                return {"type": "uniform", "value": albedo}
            case FundusSite(site=site):
                return spectral.reflectance_spectrum(site)
            case Fundus() as retina:
                maps = fundus_maps(retina)
                if band is None:
                    return fundus_texture(mi, dr, maps, retina, EXTENT, "local" if retina.spread else "whole")
                border = round((EXTENT - MAP_EXTENT) / TEXEL)
                grey = np.pad(maps.band(band, retina, TEXEL), border, mode="edge")
            case PhotoRetina():
                grey = self.map
            case unknown:
                assert_never(unknown)
        bitmap = mi.Bitmap(np.array(grey, np.float32)[..., None])  # Mitsuba takes no read-only one
        return {"type": "bitmap", "bitmap": bitmap, "raw": True, "filter_type": "bilinear", "wrap_mode": "clamp"}

    @staticmethod
    def texture_coordinates(arc: NDArray[np.float64]) -> NDArray[np.float64]:
        """Mitsuba's (u, v) `[..., 2]` of arc coordinates `[..., 2]` [mm]: v = 0 is the map's first row, at +y."""
        return np.stack([0.5 + arc[..., 0] / (2.0 * EXTENT), 0.5 - arc[..., 1] / (2.0 * EXTENT)], axis=-1)


@functools.lru_cache(maxsize=2)
def _photo_map(retina: PhotoRetina) -> NDArray[np.float32]:
    """The photograph's luminance without its uneven illumination, continued beyond its field by reflection."""
    data = np.frombuffer(resources.files("conespot.render").joinpath("data/retina.jpg").read_bytes(), np.uint8)
    photo = cv2.imdecode(data, cv2.IMREAD_COLOR)
    if photo is None:
        raise RuntimeError("render/data/retina.jpg cannot be decoded: the installation is damaged")
    linear = srgb.decoded(np.arange(256) / np.float64(255.0))[photo]
    luminance = linear @ [0.0722, 0.7152, 0.2126]  # IEC 61966-2-1, blue first as OpenCV decodes

    centre_x, centre_y, radius = _FIELD
    n = round(2.0 * EXTENT / TEXEL)
    x, y = np.meshgrid((np.arange(n) + 0.5) - n / 2.0, (np.arange(n) + 0.5) - n / 2.0)
    rho = np.maximum(np.hypot(x, y), 1e-9)
    folded = radius - np.abs(np.mod(rho, 2.0 * radius) - radius)
    source_x, source_y = centre_x + x * folded / rho, centre_y + y * folded / rho
    filled = cv2.remap(
        luminance.astype(np.float32),
        source_x.astype(np.float32) - 0.5,
        source_y.astype(np.float32) - 0.5,
        cv2.INTER_LINEAR,
        borderMode=cv2.BORDER_REPLICATE,
    )
    # 3 mm keeps vessels, fovea and disc and takes away the falling-off towards the photograph's rim
    small = cv2.resize(filled, None, fx=0.1, fy=0.1, interpolation=cv2.INTER_AREA)
    shade = cv2.GaussianBlur(small, (0, 0), 0.1 * 3.0 / TEXEL)
    flat = filled / cv2.resize(shade, (n, n), interpolation=cv2.INTER_LINEAR)
    central = slice(n // 2 - 500, n // 2 + 500)  # the paper's 10 x 10 mm area of interest
    low, high = retina.contrast
    relative = np.clip(flat / flat[central, central].mean(), low, high)
    albedo = (retina.mean * relative / relative[central, central].mean()).astype(np.float32)
    albedo.flags.writeable = False
    return albedo
