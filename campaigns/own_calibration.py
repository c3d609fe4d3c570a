"""`campaign calibrate`: what a sequence of one's own frames shows of the microscope and the eye, as a scene's file."""

from __future__ import annotations

import math
import os
import textwrap
from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path

from conespot.campaigns.destinations import check_destinations
from conespot.campaigns.knowledge import Knowledge
from conespot.campaigns.own_scene import described_scene
from conespot.campaigns.streams import shown
from conespot.localize.blur import SharedBlur, shared_blur
from conespot.localize.calibration import NAMES, QUANTITIES, Calibration, Width, calibrate
from conespot.localize.deep_light import DEEP, SharedDeep, shared_deep
from conespot.localize.frames.reader import read_frames
from conespot.localize.model.deep import Deep
from conespot.localize.settled_fits import Begun
from conespot.scene import InputError, Scene
from conespot.scene.atomic import can_hold, write_atomically
from conespot.scene.document import Document, dump, find_document, read_value
from conespot.scene.identity import essence
from conespot.scene.population import SEMI_AXES_SIGMA_MM
from conespot.scene.quantity import format_quantity
from conespot.scene.scene import KNOWLEDGE, read_scene

#: what would show a quantity that a sequence does not, by the beginning of its name
_REMEDIES = {
    "half_angle": "three spotlights on one needle, or a chart at a known distance from the tip",
    "softness": "frames whose patch is not clipped, near and far",
    "eye_radius": "tips 5 mm apart all over the retina, or the eye's axial length by biometry",
    "camera_height": "an object of known size in the eye, since no frame tells how large the whole scene is",
    "camera_tilt": "patches over all of the retina, or OpenCV's calibration of the microscope with its attitude",
    "retina": "tips 5 mm apart all over the retina, or OCT of it",
    "deep": "frames without clipped light, of hard-edged patches on several places of the same retina",
    "rcm": "tips further apart to the sides and in height: their axes meet in the RCM",
}
#: what no sequence is asked about, and who says it
_NEVER = "camera's lens: take OpenCV's calibration of the microscope as camera: {calibration: FILE}"
#: what is asked about only with an option
_UNASKED = "camera's tilt: give --tilt to have it asked for"
_EXACT_MM = 1e-9
_WIDTH = 110
#: how far a camera may lean otherwise than told, towards +x and towards +y [deg]
_TILT_DEG = 2.0


def calibrate_own(
    sources: Sequence[Path], name: str, settings: Sequence[str], out: Path, *, shape: bool, tilt: bool
) -> Iterator[str]:
    """Calibrate a scene from frames and write it with its knowledge; what was found, a line a quantity.

    With `shape` the retina's semi-axes are found in place of the eye's radius, with `tilt` which way the camera leans,
    too. Raises InputError for a scene or frames that cannot be used, fewer than three frames in which the patch can be
    measured, and a file that cannot be written.
    """
    given = find_document(name, "scene", "presets", "scene preset")
    if out.exists() and os.path.samefile(out, given):
        raise InputError(f"{out}: is the scene that is calibrated (--scene); choose another --out")
    check_destinations({"--out": out}, {"FRAMES": sources}, (name, settings))
    can_hold(out, "--out")
    scene, knowledge = described_scene(name, settings, "calibrate")
    width = Width()
    if shape:
        width = replace(width, eye_radius_mm=_EXACT_MM, semi_axes_mm=SEMI_AXES_SIGMA_MM)
    if tilt:
        width = replace(width, camera_tilt_deg=_TILT_DEG)
    # read again each time, since a video need not fit into memory; but the needle is searched for once
    begun = Begun(lambda: (frame.image for frame in read_frames(sources, scene)))
    found = calibrate(begun, scene, width=width)
    calibrated = found.applied(scene)
    blur = shared_blur(begun, calibrated)
    calibrated = calibrated if blur is None else blur.applied(calibrated)
    deep = shared_deep(begun, calibrated)
    said = [*_said(found), *_said_of_blur(blur), *_said_of_deep(deep, calibrated), *found.correlations().splitlines()]
    known = _known(knowledge, found, deep, width)
    said += [
        *_kept(knowledge, known, found),
        *(f"not asked: {words}" for words in ([] if tilt else [_UNASKED]) + [_NEVER]),
    ]
    calibrated = calibrated if deep is None else deep.applied(calibrated)
    text = _file(calibrated, known, found, said)
    read_scene(Document(str(out), _without_knowledge(text, out), folder=out.parent))  # what is written can be read
    write_atomically(out, text.encode())
    yield from said
    yield f"{shown(str(out))}: from {found.frames} frames; next: campaign localize FRAMES --scene {shown(str(out))}"


def _said(found: Calibration | SharedDeep) -> Iterator[str]:
    """A line a quantity: its value and sigma, or what would show it."""
    for line in found.statement().splitlines():
        quantity = line.partition(":")[0]
        remedy = next(said for start, said in _REMEDIES.items() if quantity.startswith(start))
        yield line if found.observable[quantity] else f"{line}; what would show it: {remedy}"


def _kept(knowledge: Knowledge, known: dict[str, object], found: Calibration) -> Iterator[str]:
    """A line a sigma of the scene's file that stays as it was told, since the sequence does not show its quantity."""
    fields = [_field(quantity.known) for quantity in QUANTITIES] + ["rcm_sigma"] * 3
    asked = [field in known and sigma > _EXACT_MM for field, sigma in zip(fields, found.sigmas, strict=True)]
    unseen = [
        field for field, name, was in zip(fields, NAMES, asked, strict=True) if was and not found.observable[name]
    ]
    for field in dict.fromkeys(unseen):
        line = f"{field} stays {known[field]}, as told"
        exact = getattr(knowledge, field) == 0.0
        yield f"{line}: localize takes it as exact; write how well it is known, if it is not" if exact else line


def _said_of_deep(deep: SharedDeep | None, scene: Scene) -> Iterator[str]:
    """Lines on the deep light; what would show it where these frames do not, or the scene has none to be asked for."""
    if deep is not None:
        yield from _said(deep)
    elif scene.spread is None:
        yield "deep light: the scene has none; to have it asked for, give the scene retina: {kind: fundus, spread: {}}"
    elif Deep.of(scene) is None:
        yield "deep light: too little to be seen at this wavelength; what would show it: infrared light"
    else:
        yield f"deep light: not observable from this sequence; what would show it: {_REMEDIES['deep']}"


def _said_of_blur(blur: SharedBlur | None) -> Iterator[str]:
    """A line on the blur; what would show one where these frames do not."""
    if blur is not None and blur.observable:
        yield blur.statement()
        return
    said = "blur: not observable from this sequence" if blur is None else blur.statement()
    yield f"{said}; what would show it: patches that are not clipped, or a slanted edge in focus (ISO 12233)"


def _file(scene: Scene, known: dict[str, object], found: Calibration, said: Sequence[str]) -> str:
    """The text of a calibrated scene's file: what was found in comments, the scene, and how well it is known."""
    lines = [f"# Written by `campaign calibrate` from {found.frames} frames, with standard deviations:"]
    lines += [textwrap.fill(line, _WIDTH, initial_indent="#   ", subsequent_indent="#     ") for line in said]
    lines += ["# What is not said here is as conespot has it by default; `campaign explain KEY` says what a key means."]
    lines += [dump(essence(scene)).rstrip(), "# how well the localizers may take it to be known"]
    return "\n".join([*lines, dump({KNOWLEDGE: known})])


def _known(knowledge: Knowledge, found: Calibration, deep: SharedDeep | None, width: Width) -> dict[str, object]:
    """The sigmas of a scene's file: what was found as well as it was, the rest as well as it was known before."""
    known = {key: value for key, value in knowledge.model_dump(mode="json").items() if key.endswith("_sigma")}
    worst: dict[str, float] = {}  # of all quantities that one key is about
    for quantity, sigma in zip(QUANTITIES, found.sigmas, strict=False):
        field = _field(quantity.known)
        if found.observable[quantity.name] and field in known:
            worst[field] = max(worst.get(field, 0.0), float(f"{sigma / quantity.per_unit:.3g}"))
            known[field] = f"{worst[field]:g} {quantity.unit}" if quantity.unit else worst[field]
    if all(found.observable[name] for name in NAMES[-3:]):
        sideways = math.hypot(width.play_mm, float(max(found.sigmas[-3:])))
        known["rcm_sigma"] = format_quantity(float(f"{sideways:.3g}"), "length")
    if deep is not None:  # the next frame has its patch on another place
        for quantity, sigma in zip(DEEP, deep.places, strict=True):
            if deep.observable[quantity.name]:
                known[quantity.known] = float(f"{sigma:.3g}")
    return known


def _field(known: str) -> str:
    """The key of `Knowledge` for a field of `Knowns`, which has its unit behind it."""
    return known.removesuffix("_deg").removesuffix("_mm")


def _without_knowledge(text: str, out: Path) -> dict[str, object]:
    data: dict[str, object] = read_value(text, str(out))
    return {key: value for key, value in data.items() if key != KNOWLEDGE}
