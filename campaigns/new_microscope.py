"""`campaign init --microscope`: a commented scene of one's own camera, eye and needle, from a few answers."""

from __future__ import annotations

import math
import os
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path

from conespot.campaigns.questions import Question, write_answered

#: the answer of a question that does not matter here
NONE = "none"
#: of a described camera: with the focal length it says which angle a row sees, and nothing else
_SENSOR_WIDTH_MM = 36.0


def _quantity(kind: str, low: float, high: float) -> Callable[[str], str]:
    """A check of a quantity between two bounds, in the unit held inside."""

    def check(text: str) -> str:
        from conespot.scene.quantity import format_quantity, parse_quantity

        value = parse_quantity(text, kind, bare=False)
        if not low <= value <= high:
            bounds = f"{format_quantity(low, kind)} to {format_quantity(high, kind)}"
            raise ValueError(f"expected {bounds}, got {text!r}")
        return text

    return check


def _pixels(text: str) -> str:
    sides = text.lower().split("x")
    if len(sides) != 2 or not all(side.isascii() and side.isdecimal() and 8 <= int(side) <= 20_000 for side in sides):
        raise ValueError(f"expected columns and rows such as 1920x1080, got {text!r}")
    return f"[{int(sides[0])}, {int(sides[1])}]"


def _number(low: float, high: float) -> Callable[[str], str]:
    """A check of a plain number between two bounds."""

    def check(text: str) -> str:
        try:
            value = float(text)
        except ValueError:
            value = math.nan
        if not low <= value <= high:
            raise ValueError(f"expected a number from {low:g} to {high:g}, got {text!r}")
        return f"{value:g}"

    return check


def _bits(text: str) -> str:
    if text not in {str(bits) for bits in range(8, 17)}:
        raise ValueError(f"expected 8 to 16, got {text!r}")
    return text


def _point(text: str) -> str:
    from conespot.scene.quantity import parse_quantity

    parts = [part.strip() for part in text.split(",")]
    if len(parts) != 3:
        raise ValueError(f"expected three lengths such as 6 mm, 0 mm, 22 mm, got {text!r}")
    for part in parts:
        parse_quantity(part, "length", bare=False)
    return f"[{', '.join(parts)}]"


def _calibration(text: str) -> str:
    if text == NONE:
        return text
    if not Path(text).is_file():
        raise ValueError(f"{text}: no such file; answer {NONE} if there is none")
    from conespot.scene.calibration_file import intrinsics

    intrinsics(Path(text), _SENSOR_WIDTH_MM)  # a bad one is refused here, where the option can be named
    return text


def _rigs() -> list[str]:
    from conespot.scene.spotlights import RIGS

    return list(RIGS)


QUESTIONS = (
    Question(
        "calibration", "OpenCV's calibration file of the camera, or none", NONE, metavar="FILE", check=_calibration
    ),
    Question("pixels", "columns and rows of a frame, if there is none", "1920x1080", metavar="CxR", check=_pixels),
    Question(
        "field", "how much of the retina a row of the frame shows", "13.2 mm", metavar="LENGTH",
        check=_quantity("length", 0.1, 200.0),
    ),
    Question(
        "distance", "from the camera's entrance pupil to the retina, in air", "110 mm", metavar="LENGTH",
        check=_quantity("length", 50.0, 2000.0),
    ),
    Question(
        "values", "what pixel values are: srgb (as on screens) or linear (proportional to light)", "linear",
        choices=lambda: ("linear", "srgb", "srgb-colour"),
    ),
    Question("bits", "bits of a linear value", "12", metavar="N", check=_bits),
    Question(
        "alignment", "where they stand in the 16 of a file: right (12 bits end at 4095) or left", "right",
        choices=lambda: ("right", "left"),
    ),
    Question("black", "pixel value without light", "0", metavar="VALUE", check=_number(0.0, 60_000.0)),
    Question(
        "electrons", "electrons that fill a pixel to its largest value (the camera's full well)", "10000", metavar="N",
        check=_number(10.0, 1e7),
    ),
    Question("read-noise", "its noise in the dark, in electrons", "15", metavar="N", check=_number(0.0, 1e4)),
    Question(
        "range", "range of a video recorder's codes: none recorded, full (0 to 255) or limited (16 to 235)", NONE,
        choices=lambda: (NONE, "full", "limited"),
    ),
    Question("radius", "radius of the eye", "12 mm", metavar="LENGTH", check=_quantity("length", 5.0, 20.0)),
    Question(
        "trocar", "remote centre of motion, from the posterior pole, +z to the camera", "6 mm, 0 mm, 22 mm",
        metavar="X,Y,Z", check=_point,
    ),
    Question(
        "trocar-sigma", "how well it is known", "0.05 mm", metavar="LENGTH", check=_quantity("length", 0.0, 5.0)
    ),
    Question("rig", "how many cones of light the needle carries", "single", choices=_rigs),
    Question(
        "half-angle", "half the full angle of a cone", "9 deg", metavar="ANGLE", check=_quantity("angle", 0.01, 1.2)
    ),
    Question(
        "edge", "the cone's edge: hard, or soft (brightest on the axis, fading to the rim)", "hard",
        choices=lambda: ("hard", "soft"),
    ),
)  # fmt: skip


def write_microscope(path: Path, answers: Mapping[str, str]) -> None:
    """Write the scene that the answers describe to a new file.

    Raises InputError, with nothing written, if the file is there, cannot be written, or the answers do not go together.
    """
    from conespot.scene.scene import read_scene, without_knowledge

    write_answered(path, _lines(path, answers), lambda document: read_scene(without_knowledge(document)))


def _lines(path: Path, answers: Mapping[str, str]) -> Iterator[str]:
    yield f"# Written by `campaign init --microscope`. Next: `campaign localize FRAMES --scene {path.name}`, or first"
    yield f"# `campaign calibrate FRAMES --scene {path.name} --out calibrated.yaml`."
    yield "# Millimetres from the posterior pole, +z towards the camera; `campaign explain KEY` explains a key."
    yield "preset: paper # what is not said here comes from it"
    yield "camera:"
    yield from _camera(path, answers)
    yield from _sensor(answers)
    yield f"eye: {{radius: {answers['radius']}}} # docs/reality.md has its lens and a contact lens"
    yield "instrument:"
    yield f"  rcm: {answers['trocar']} # remote centre of motion: the trocar"
    yield f"spotlights: {answers['rig']}"
    kind = "{kind: hard" if answers["edge"] == "hard" else "{kind: cycles, blend: 1"
    yield f"beam: {kind}, half_angle: {answers['half-angle']}}}"
    yield "#retina: {kind: fundus} # a localizer needs no retina; renderings do"
    yield "knowledge: # how well the localizers may take what is said above to be known; 0 is exactly"
    yield f"  rcm_sigma: {answers['trocar-sigma']} # or free"
    yield "  #half_angle_sigma: 0.01 deg"
    yield "  #eye_radius_sigma: 0.3 mm"
    yield "  #camera_tilt_sigma: 1 deg"
    yield "  #relief_sigma: 0.05 mm # by which bumps nobody measured may raise the wall; for the distance alone"


def _camera(path: Path, answers: Mapping[str, str]) -> Iterator[str]:
    from conespot.scene.quantity import format_quantity, parse_quantity

    distance = parse_quantity(answers["distance"], "length")
    if answers["calibration"] != NONE:
        beside = os.path.relpath(answers["calibration"], path.parent)
        yield f"  calibration: {beside} # resolution, focal length, principal point and distortion"
    else:
        width = _SENSOR_WIDTH_MM
        focal = format_quantity(float(f"{width * distance / parse_quantity(answers['field'], 'length'):.6g}"), "length")
        yield f"  resolution: {answers['pixels']} # columns and rows [px]"
        yield f"  sensor_width: {width:g} mm # with the focal length it says which angle a row sees, nothing else"
        yield f"  focal_length: {focal} # so that a row shows {answers['field']} at {answers['distance']}"
    yield f"  height: {answers['distance']} # of the entrance pupil above the posterior pole, along the camera's axis"
    yield "  #tilt: 5 deg # off the vertical"
    yield "  #azimuth: 90 deg # towards which it is tilted, from +x to +y"


def _sensor(answers: Mapping[str, str]) -> Iterator[str]:
    linear = answers["values"] == "linear"
    full, black = 2 ** int(answers["bits"]) - 1, float(answers["black"])
    gain = (full - black) / float(answers["electrons"])
    inner = "  " if linear else "    "
    yield "sensor: # noise as EMVA 1288 states it of a camera; without it no sigma of a real frame holds"
    if not linear:
        yield "  kind: recorded # eight bits with the sRGB transfer"
        span, quality = ("full", 100) if answers["range"] == NONE else (answers["range"], 90)
        yield f"  range: {span} # of codes: full is 0 to 255, limited 16 to 235"
        yield f"  quality: {quality} # of its compression, as JPEG counts"
        yield "  camera:"
    yield f"{inner}kind: emva # proportional to light"
    chip = "rgb # red, green and blue" if answers["values"] == "srgb-colour" else "mono # grey"
    yield f"{inner}chip: cmv12000-{chip}"
    yield f"{inner}bits: {answers['bits']}"
    yield f"{inner}black_level: {black:g} # value without light"
    yield f"{inner}gain: {gain:.6g} # of a value an electron"
    yield f"{inner}full_well: {answers['electrons']} # electrons"
    yield f"{inner}read_noise: {answers['read-noise']} # electrons"
    yield "storage: # what files leave open; a frame that does not fit is refused with the key to write here"
    yield f"  alignment: {answers['alignment']} # where the sensor's bits stand in the 16 of a file"
    yield "  #turned: 90 # clockwise, after what the file itself says"
    yield "  #channel: green # of colour files, for a grey sensor"
