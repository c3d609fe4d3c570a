"""What a number assumes: radius, edge profile, power convention, transfer, threshold, ambiguity."""

from __future__ import annotations

import functools
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from typing import Any

from pydantic import TypeAdapter, ValidationError

from conespot.scene.beam import Beam, CyclesBeam, LinearBeam, TabulatedBeam
from conespot.scene.document import merge, read_document, shipped
from conespot.scene.power import Power
from conespot.scene.quantity import FROM_FILE, format_quantity

_NOT_STATED = "not stated"
_BEAM = TypeAdapter[Any](Beam)
#: threshold and answer to the two-fold ambiguity, by localizer
_RCM = "RCM for one spotlight, least spread for several"
_CODED = "fixed 50 of 255 after median 9"
_WHOLE = f"{_CODED}, outline cut to whole pixels"
_LOCALIZERS = {
    "paper": ("Otsu after Gaussian and median", _RCM),
    "paper-code": (_WHOLE, _RCM),
    "paper-code-float": (_CODED, _RCM),
    "paper-code-oracle": (_WHOLE, "candidate nearest the truth (oracle)"),
    "cone": ("none (edges below the pixel)", "none (exact cone, RCM as a prior)"),
    "photometric": ("none (likelihood of the pixels)", "none (exact cone, RCM as a prior)"),
}
_CONVENTIONS = {"isotropic": "isotropic (I0 = P / 4 pi)", "flux": "flux (P leaves the tip)"}


@dataclass(frozen=True)
class Assumptions:
    """The assumption set that stands beside every number."""

    radius: str
    edge: str
    power_convention: str
    transfer: str
    threshold: str
    ambiguity: str

    def columns(self) -> dict[str, str]:
        """The set as columns of a table."""
        return asdict(self)

    def sentence(self) -> str:
        """The set in one line."""
        return "; ".join(f"{key.replace('_', ' ')}: {value}" for key, value in asdict(self).items())


def assumptions(scene: Mapping[str, Any], setting: Mapping[str, Any]) -> Assumptions:
    """The assumption set of the rows with a `setting` (group columns and values) in a run with a resolved `scene`.

    A swept key's column overrules the scene, so each row is described as it was rendered.
    """
    here = scene_of(scene, setting)
    localizer = str(setting.get("localizer"))
    threshold, ambiguity = _LOCALIZERS.get(localizer, (f"see {localizer}", f"see {localizer}"))
    convention = _text(here, "power", "convention")
    return Assumptions(
        radius=_text(here, "eye", "radius"),
        edge=_edge(here),
        power_convention=_CONVENTIONS.get(convention, convention),
        transfer=_transfer(here, setting.get("sensor")),
        threshold=threshold,
        ambiguity=ambiguity,
    )


def theory_assumptions() -> Assumptions:
    """The assumption set of Table I: by definition the paper's sphere (z0 = -7 mm), with no light and no image."""
    none = "not used"
    return Assumptions("12 mm", none, none, none, none, none)


def scene_of(scene: Mapping[str, Any], setting: Mapping[str, Any]) -> dict[str, Any]:
    """The scene of the rows with a `setting`: a swept preset filled in, swept values laid on it.

    The column of a swept scene key is its dotted path, with or without `scene.` before it. Only shipped presets are
    read: the name may come from a stranger's run.
    """
    result = {key: value for key, value in scene.items() if key != "preset"}
    preset = setting.get("scene", setting.get("scene.preset", scene.get("preset")))
    result = merge(_preset(str(preset)), result)
    for column, value in setting.items():
        path = column.removeprefix("scene.").split(".")
        if "." not in column or path[0] not in result or path == ["preset"]:
            continue
        nested: Any = value
        for key in reversed(path):
            nested = {key: nested}
        result = merge(result, nested)
    return result


@functools.lru_cache(maxsize=64)
def _preset(name: str) -> dict[str, Any]:
    file = shipped("scene", "presets").get(name)
    return read_document(file).data if file is not None else {}


@dataclass(frozen=True)
class Watts:
    """A spotlight's power in both conventions: `isotropic_w` as Blender's, `flux_w` as it leaves the tip [W]."""

    isotropic_w: float
    flux_w: float
    axial_intensity: float  #: on-axis radiant intensity [W/sr]

    def words(self) -> str:
        """Both, such as "1 W isotropic (3.08 mW flux)"."""
        return f"{self.isotropic_w:.4g} W isotropic ({1e3 * self.flux_w:.3g} mW flux)"


def both_conventions(scene: Mapping[str, Any], power_w: float) -> Watts | None:
    """What `power_w` of the scene's convention is in both; None if the scene states no beam or no convention.

    Isotropic: I0 = P / 4 pi. Flux: I0 = P / integral of the beam profile over solid angle.
    """
    beam = _beam(scene)
    try:
        stated = Power(value=power_w, convention=_text(scene, "power", "convention"))
    except ValidationError:
        return None
    if beam is None:
        return None
    intensity = stated.axial_intensity(beam)
    isotropic = intensity / Power(value=1.0, convention="isotropic").axial_intensity(beam)
    return Watts(isotropic, stated.flux(beam), intensity)


def _beam(scene: Mapping[str, Any]) -> Beam | None:
    try:
        beam: Beam = _BEAM.validate_python(scene.get("beam"), context={FROM_FILE: True})
    except ValidationError:
        return None
    return beam


def _text(scene: Mapping[str, Any], part: str, key: str) -> str:
    inner = scene.get(part)  # a part that was swept as a whole is the text of its column
    value = inner.get(key) if isinstance(inner, Mapping) else inner
    if value is None or isinstance(value, (dict, list)):
        return _NOT_STATED
    return " ".join((f"{value:g}" if isinstance(value, float) else str(value)).split())[:80]


def _edge(scene: Mapping[str, Any]) -> str:
    beam = _beam(scene)
    if beam is None:
        return _text(scene, "beam", "kind")
    half_angle = f"half angle {format_quantity(beam.half_angle, 'angle')}"
    if isinstance(beam, CyclesBeam):
        soft = " (fully soft)" if beam.blend == 1.0 else ""
        return f"Cycles blend {beam.blend:g}{soft}, {half_angle}"
    if isinstance(beam, LinearBeam):
        return f"linear from {format_quantity(beam.beam_width, 'angle')}, {half_angle}"
    return f"{'tabulated' if isinstance(beam, TabulatedBeam) else 'hard'}, {half_angle}"


def _transfer(scene: Mapping[str, Any], sensor: object) -> str:
    kind = _text(scene, "sensor", "kind")
    if sensor is not None and sensor != kind:
        return str(sensor)  # a swept sensor: the resolved scene describes another one
    white = f"white {_text(scene, 'sensor', 'white')}"
    if kind == "srgb8":
        return f"sRGB, 8 bit, {white}"
    if kind == "linear":
        return f"linear, {_text(scene, 'sensor', 'bits')} bit, {white}"
    return kind
