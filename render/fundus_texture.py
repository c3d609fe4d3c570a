"""The fundus' closed form as a Mitsuba texture, evaluated at every sampled wavelength and place.

Dr.Jit traces the Python code once, so it runs at full speed in every JIT variant. The scalar variant, which would
call Python for every sample, uses maps averaged over each channel's band instead (see `reflectance.py`).
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any, Literal, assert_never

import numpy as np
from numpy.typing import NDArray

from conespot.render.fundus_anatomy import EXTENT
from conespot.render.fundus_maps import TILE, FundusMaps
from conespot.scene import fundus
from conespot.scene.retina import Fundus

if TYPE_CHECKING:
    from mitsuba import Bool, Float, Properties, SurfaceInteraction3f, Texture, UnpolarizedSpectrum

#: wavelengths of the tables [nm]
_LOW, _HIGH = 300.0, 1100.0
_LN10 = math.log(10.0)

#: the whole reflectance; what comes back where it falls; or the root of the rest, which light passes going in and out
Part = Literal["whole", "local", "passage"]


def fundus_texture(mi: Any, dr: Any, maps: FundusMaps, retina: Fundus, extent: float, part: Part = "whole") -> Texture:
    """A Mitsuba texture whose coordinates run over +-`extent` mm of arc, v downwards; for JIT variants."""

    class FundusTexture(mi.Texture):  # type: ignore[misc]
        """R(wavelength, u, v) of `scene.fundus` with parameters from maps."""

        def __init__(self, properties: Properties) -> None:
            super().__init__(properties)
            clamp = {"filter_mode": dr.FilterMode.Linear, "wrap_mode": dr.WrapMode.Clamp, "use_accel": False}
            layers = np.stack([maps.melanin, maps.blood, maps.epithelium, maps.macular, maps.disc], axis=-1)
            self.layers = mi.Texture2f(mi.TensorXf(layers), **clamp)
            vessels = np.stack([maps.artery, maps.vein], axis=-1)
            self.vessels = mi.Texture2f(mi.TensorXf(vessels), **clamp)
            repeat = {**clamp, "wrap_mode": dr.WrapMode.Repeat}
            self.mosaic = mi.Texture2f(mi.TensorXf(maps.mosaic[..., None]), **repeat)
            self.spectra = mi.Texture1f(mi.TensorXf(_spectra(retina)), **clamp)
            self.typical = float(np.mean(maps.reflectance(650.0, retina, 0.08)))

        def eval(self, si: SurfaceInteraction3f, active: Bool | bool = True) -> UnpolarizedSpectrum:
            """Reflectance at the four wavelengths of `si`."""
            centred = mi.Point2f(si.uv.x - 0.5, si.uv.y - 0.5) * (2.0 * extent)  # arc [mm], y downwards
            uv = mi.Point2f(0.5 + centred.x / (2.0 * EXTENT), 0.5 + centred.y / (2.0 * EXTENT))
            melanin, blood, epithelium, macular, disc = self.layers.eval(uv, active)
            artery, vein = self.vessels.eval(uv, active)
            grain = 1.0 + self.mosaic.eval((centred + EXTENT) / TILE, active)[0]
            result = mi.UnpolarizedSpectrum(0.0)
            for i in range(len(si.wavelengths)):
                at = (si.wavelengths[i] - _LOW + 0.5) / (_HIGH - _LOW + 1.0)
                template, choroid, arterial, venous, scatter, yellow, white = self.spectra.eval(mi.Float(at), active)
                absorbed = dr.exp(-grain * (template * melanin + choroid * blood))
                behind = dr.square(1.0 - epithelium) * scatter * absorbed
                match part:
                    case "whole":
                        surface = dr.lerp((epithelium + behind) * dr.exp(-yellow * macular), white, disc)
                    case "local":
                        surface = dr.lerp(epithelium * dr.exp(-yellow * macular), white, disc)
                    case "passage":
                        surface = (1.0 - disc) * behind * dr.exp(-yellow * macular)
                    case _:
                        assert_never(part)
                for path, mu in ((artery, arterial), (vein, venous)):
                    surface *= fundus.BLOOD.bypass + (1.0 - fundus.BLOOD.bypass) * dr.exp(-mu * path)
                result[i] = dr.sqrt(surface) if part == "passage" else surface
            return result & active

        def mean(self) -> Float:
            """Something like the mean reflectance; Mitsuba only weighs lobes with it."""
            return mi.Float(self.typical)

        def max(self) -> float:
            """Bound of the reflectance."""
            return 1.0

        def is_spatially_varying(self) -> bool:
            """It is."""
            return True

        def to_string(self) -> str:
            """For Mitsuba's printing of scenes."""
            return "FundusTexture[]"

    return FundusTexture(mi.Properties())


def _spectra(retina: Fundus) -> NDArray[np.float32]:
    """The closed form's spectra `[801, 7]`, at whole nanometres, with the double pass in them.

    Exponents per unit of melanin density and per um of choroidal, arterial and venous blood; scatter; exponent per
    unit of macular density; the disc's reflectance.
    """
    x = np.arange(_LOW, _HIGH + 1.0)
    columns = [
        2.0 * _LN10 * fundus.melanin_template(x),
        2.0 * fundus.blood_absorption(x, fundus.BLOOD.choroid_saturation),
        2.0 * fundus.blood_absorption(x, retina.artery_saturation),
        2.0 * fundus.blood_absorption(x, retina.vein_saturation),
        fundus.scatter(x),
        2.0 * _LN10 * fundus.macular_template(x),
        fundus.disc_reflectance(x),
    ]
    return np.stack(columns, axis=-1).astype(np.float32)
