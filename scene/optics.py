"""The eye's optics: cornea, pupil, lens and contact lens, which the camera sees the retina through.

R. Navarro's wide-angle eye (I. Escudero-Sanz, R. Navarro, JOSA A 16:1881, 1999), Le Grand's full theoretical eye
(Y. Le Grand, S. G. El Hage, Physiological Optics, 1980), and D. A. Atchison's eyes of any refraction (Vision Res.
46:2236, 2006). They stand on the z axis, the retina's pole at the origin and the cornea above: the pole is on the
optical axis.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Annotated, Literal, assert_never

from pydantic import BeforeValidator, Field, model_validator

from conespot.scene import media
from conespot.scene.media import Medium, Numbers
from conespot.scene.model import Model, Words
from conespot.scene.quantity import Dioptres, Length, format_quantity
from conespot.scene.refraction import Interface, Root, Vector, through, to_plane

#: of a pupil [mm]: drugs leave one of a millimetre; through less, a microscope sees a few pixels or none
_NARROWEST = 0.5
#: thickness in the middle of the flat contact lens [mm]; it shifts the image by a third of that
_CONTACT = 1.0
#: intraocular lens: front and back radius, thickness, and how far behind the front of the cornea it stands [mm]
_IMPLANT = 21.557, -22.0, 0.593, 4.70
#: [nm], at which Le Grand's indices stand, and at which a camera sees that has not been told another
SODIUM = 589.3


@dataclass(frozen=True)
class _Face:
    """Radius R [mm], positive if the centre lies towards the retina, asphericity Q, and what follows behind [mm]."""

    radius: float
    asphericity: float
    thickness: float


@dataclass(frozen=True)
class ModelEye:
    """A published eye: its faces from the front, and the semi-axes of its retina along x, y and z [mm]."""

    cornea: tuple[_Face, _Face]
    lens: tuple[_Face, _Face] | None  #: None for a graded one, which is not traced
    lens_thickness: float  #: [mm]
    vitreous: float  #: from the lens to the retina [mm]
    retina: tuple[float, float, float]
    indices: dict[Medium, float] = field(default_factory=dict)  #: where they are not Navarro's, at 589.3 nm

    @property
    def pupil_depth(self) -> float:
        """From the front of the cornea to the iris, which is where the lens begins [mm]."""
        return self.cornea[0].thickness + self.cornea[1].thickness

    @property
    def length(self) -> float:
        """From the front of the cornea to the posterior pole [mm]."""
        return self.pupil_depth + self.lens_thickness + self.vitreous


_NAVARRO = ModelEye(
    cornea=(_Face(7.72, -0.26, 0.55), _Face(6.50, 0.0, 3.05)),
    lens=(_Face(10.2, -3.1316, 4.0), _Face(-6.0, -1.0, 16.3203)),
    lens_thickness=4.0,
    vitreous=16.3203,
    retina=(12.0, 12.0, 12.0),
)
_LE_GRAND = ModelEye(
    cornea=(_Face(7.8, 0.0, 0.55), _Face(6.5, 0.0, 3.05)),
    lens=(_Face(10.2, 0.0, 4.0), _Face(-6.0, 0.0, 16.59655)),
    lens_thickness=4.0,
    vitreous=16.59655,
    retina=(13.4, 13.4, 13.4),
    indices={"cornea": 1.3771, "aqueous": 1.3374, "lens": 1.42, "vitreous": 1.336},
)


def _atchison(refraction: float) -> ModelEye:
    """Atchison's eye of a spherical refraction [D]."""
    return ModelEye(
        cornea=(_Face(7.77 + 0.022 * refraction, -0.15, 0.55), _Face(6.40, -0.275, 3.15)),
        lens=None,
        lens_thickness=3.6,
        vitreous=16.28 - 0.299 * refraction,
        retina=(11.455 - 0.043 * refraction, 11.365 - 0.090 * refraction, 10.148 - 0.163 * refraction),
    )


class Optics(Model):
    """What stands between the air and the vitreous. Beyond the pupil the camera sees black.

    An aphakic eye has aqueous above the plane of the iris and vitreous below; an intraocular lens stands a millimetre
    behind it. The flat contact lens is plano-concave, of PMMA, and fits the cornea without a gap; its rim is
    not in the way.

    >>> eye = Optics(eye="navarro", contact="flat")
    >>> round(eye.model.length, 4), eye.words
    (23.9203, 'navarro eye, phakic, flat contact lens, pupil 8 mm')
    """

    eye: Literal["navarro", "le-grand", "atchison"] = "navarro"
    lens: Literal["phakic", "aphakic", "pseudophakic"] = "phakic"
    contact: Literal["none", "flat"] = "none"
    pupil: Annotated[Length, Field(gt=0.0, le=10.0)] = 8.0  #: diameter of the hole in the iris [mm]
    refraction: Annotated[Dioptres, Field(ge=-15.0, le=5.0)] = 0.0  #: for which an Atchison eye is made
    age: float = Field(60.0, ge=20.0, le=80.0)  #: of the eye's own lens, which yellows [years]

    @model_validator(mode="after")
    def _known(self) -> Optics:
        if self.pupil < _NARROWEST:
            narrowest = format_quantity(_NARROWEST, "length")
            raise ValueError(
                f"pupil: no eye's is narrower than {narrowest}, got {format_quantity(self.pupil, 'length')}"
            )
        if self.refraction != 0.0 and self.eye != "atchison":
            raise ValueError(f"the {self.eye} eye has no other refraction than 0 D; eye: atchison has any")
        if self.lens == "phakic" and self.model.lens is None:
            raise ValueError(
                f"the {self.eye} eye's own lens is graded and cannot be traced: take lens: aphakic or pseudophakic,"
                " or eye: navarro"
            )
        return self

    @property
    def model(self) -> ModelEye:
        """The published eye."""
        match self.eye:
            case "navarro":
                return _NAVARRO
            case "le-grand":
                return _LE_GRAND
            case "atchison":
                return _atchison(self.refraction)
            case never:
                assert_never(never)

    @property
    def words(self) -> str:
        """The optics in words, as plans and tables state them."""
        parts = [f"{self.eye} eye", self.lens]
        if self.eye == "atchison":
            parts[0] += f" of {format_quantity(self.refraction, 'refraction')}"
        if self.contact == "flat":
            parts.append("flat contact lens")
        return ", ".join([*parts, f"pupil {format_quantity(self.pupil, 'length')}"])

    @property
    def top(self) -> float:
        """Height of the first surface's vertex above the posterior pole [mm]."""
        return self.model.length + (_CONTACT if self.contact == "flat" else 0.0)

    @property
    def iris(self) -> float:
        """Height of the pupil's plane above the posterior pole [mm]."""
        return self.model.length - self.model.pupil_depth

    @property
    def in_front(self) -> tuple[Interface, ...]:
        """The surfaces above the iris, from the top."""
        (front, back), z = self.model.cornea, self.model.length
        cornea = Interface(z, 1.0 / front.radius, front.asphericity, "cornea")
        aqueous = Interface(z - front.thickness, 1.0 / back.radius, back.asphericity, "aqueous")
        flat = (Interface(z + _CONTACT, 0.0, 0.0, "pmma"),) if self.contact == "flat" else ()
        return (*flat, cornea, aqueous)

    @property
    def behind(self) -> tuple[Interface, ...]:
        """The surfaces from the iris downwards."""
        match self.lens:
            case "phakic":
                assert self.model.lens is not None
                (front, back), z = self.model.lens, self.iris
                lens = Interface(z, 1.0 / front.radius, front.asphericity, "lens")
                return lens, Interface(z - front.thickness, 1.0 / back.radius, back.asphericity, "vitreous")
            case "aphakic":
                return (Interface(self.iris, 0.0, 0.0, "vitreous"),)
            case "pseudophakic":
                above, below, thickness, depth = _IMPLANT
                z = self.model.length - depth
                front_face = Interface(z, 1.0 / above, 0.0, "implant")
                return front_face, Interface(z - thickness, 1.0 / below, 0.0, "vitreous")
            case never:
                assert_never(never)

    def index(self, medium: Medium, wavelength: Numbers) -> Numbers:
        """Refractive index of a medium at wavelengths [nm]: this eye's, with the dispersion of Navarro's."""
        n = media.index(medium, wavelength)
        own = self.model.indices.get(medium)
        return n if own is None else n + (own - media.index(medium, SODIUM))

    def enter(
        self, origin: Vector, direction: Vector, wavelength: Numbers, sqrt: Root
    ) -> tuple[Vector, Vector, Numbers]:
        """Rays in the vitreous of downward rays in the air, origins [mm] and unit directions.

        Also how far from the axis each passes the plane of the iris, squared, in units of the pupil's radius: above 1
        the iris stops it. For wavelengths [nm]; arrays and `sqrt` are numpy's or Dr.Jit's.
        """
        first, last = self.in_front, self.behind
        indices = [1.0, *(self.index(face.below, wavelength) for face in (*first, *last))]
        origin, direction = through(first, indices[: len(first) + 1], origin, direction, sqrt)
        x, y, _ = to_plane(self.iris, origin, direction)
        origin, direction = through(last, indices[len(first) :], origin, direction, sqrt)
        return origin, direction, (x * x + y * y) * (4.0 / self.pupil**2)


def _none(value: object) -> object:
    return None if value == "none" else value


#: what the key of a file holds: `none`, or the optics
AnyOptics = Annotated[Optics | None, BeforeValidator(_none), Words(lambda: ["none"])]
