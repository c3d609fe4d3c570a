"""What the retina reflects."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field, model_validator

from conespot.scene.model import Model, named

Pigmentation = Literal["light", "medium", "dark"]
_Albedo = Annotated[float, Field(gt=0.0, le=1.0)]


class UniformRetina(Model):
    """Lambertian, the same grey everywhere."""

    kind: Literal["uniform"] = "uniform"
    albedo: _Albedo = 0.1

    @property
    def is_spectral(self) -> bool:
        """Whether the reflectance varies with wavelength: it is grey."""
        return False

    @property
    def water(self) -> bool:
        """Whether the vitreous absorbs: only in a living eye."""
        return False


class PhotoRetina(Model):
    """Lambertian grey albedo with the pattern of a fundus photograph.

    `mean` is the mean albedo; `contrast` bounds the albedo to that many times the mean, from below and above. The
    defaults are measured on the authors' released frame without spotlight: linear mean luminance of their texture
    0.083, grey values 25 to 45 around 37 (1 to 99 %), so no optic disc above the fixed threshold of 50.
    """

    kind: Literal["photo"] = "photo"
    mean: _Albedo = 0.083
    contrast: tuple[Annotated[float, Field(gt=0.0, le=1.0)], Annotated[float, Field(ge=1.0)]] = (0.52, 1.42)

    @model_validator(mode="after")
    def _physical(self) -> PhotoRetina:
        if self.mean * self.contrast[1] > 1.0:
            raise ValueError(f"mean {self.mean} times contrast {self.contrast[1]} is an albedo above 1")
        return self

    @property
    def is_spectral(self) -> bool:
        """Whether the reflectance varies with wavelength: it is grey."""
        return False

    @property
    def water(self) -> bool:
        """Whether the vitreous absorbs: only in a living eye."""
        return False


class FundusSite(Model):
    """Lambertian, everywhere the spectral reflectance of one site of Delori & Pflibsen's table (scene.fundus)."""

    kind: Literal["site"] = "site"
    site: Literal["nasal", "perifovea", "fovea"] = "perifovea"
    water: bool = True  #: whether the vitreous absorbs like water, to and from the retina

    @property
    def is_spectral(self) -> bool:
        """Whether the reflectance varies with wavelength."""
        return True


class Glint(Model):
    """Mirror reflection of the inner limiting membrane: a dielectric coat over the retina.

    Tissue of `index` under vitreous of index 1.336; `roughness` is the alpha of a GGX distribution.
    """

    index: float = Field(1.38, gt=1.0, le=2.0)
    roughness: float = Field(0.15, gt=0.0, le=1.0)


#: between which factors deep light may be more or less, and go farther or less far
LEAST_DEEP, MOST_DEEP = 0.25, 4.0


class Spread(Model):
    """Light that enters the tissue behind the pigment epithelium comes back elsewhere (scene.spread).

    `scattering` multiplies the scattering coefficients of all layers, which are known to a factor of two; `amount` the
    deep light that the closed form gives, beside a local part that stays what it is; `length` the distances it goes.
    """

    scattering: float = Field(1.0, ge=0.5, le=2.0)
    amount: float = Field(1.0, ge=LEAST_DEEP, le=MOST_DEEP)
    length: float = Field(1.0, ge=LEAST_DEEP, le=MOST_DEEP)


class Fundus(Model):
    """A living fundus: spectral reflectance from maps of pigments, blood, vessels and disc.

    The maps come from a fundus photograph or, seeded, from nothing but anatomy (`procedural`: another seed is
    another eye). `pigmentation` sets the melanin, `detail` the relative amplitude of the mosaic finer than the maps.
    """

    kind: Literal["fundus"] = "fundus"
    source: Literal["photo", "procedural"] = "photo"
    seed: int = Field(0, ge=0, lt=2**32)
    pigmentation: Pigmentation = "medium"
    vessels: bool = True
    artery_saturation: float = Field(0.97, ge=0.0, le=1.0)
    vein_saturation: float = Field(0.60, ge=0.0, le=1.0)
    detail: float = Field(0.06, ge=0.0, le=0.3)
    water: bool = True  #: whether the vitreous absorbs like water, to and from the retina
    glint: Glint | None = None
    spread: Spread | None = None  #: None: all light comes back where it falls

    @model_validator(mode="after")
    def _one_surface(self) -> Fundus:
        if self.glint is not None and self.spread is not None:
            raise ValueError("glint and spread: how deep light leaves through a coat is not worked out; leave one out")
        return self

    @property
    def is_spectral(self) -> bool:
        """Whether the reflectance varies with wavelength."""
        return True


AnyRetina = UniformRetina | PhotoRetina | FundusSite | Fundus
RETINAS: dict[str, AnyRetina] = {
    "uniform": UniformRetina(),
    "photo": PhotoRetina(),
    "fundus": Fundus(),
    "fundus-light": Fundus(pigmentation="light"),
    "fundus-dark": Fundus(pigmentation="dark"),
    "fundus-procedural": Fundus(source="procedural"),
    "nasal": FundusSite(site="nasal"),
    "perifovea": FundusSite(site="perifovea"),
    "fovea": FundusSite(site="fovea"),
}
Retina = Annotated[Annotated[AnyRetina, Field(discriminator="kind")], named(RETINAS, "retina")]
