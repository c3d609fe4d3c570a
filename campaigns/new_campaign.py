"""`campaign init`: a commented campaign of one's own, from a few answers."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from pathlib import Path

from conespot.campaigns.questions import Question, write_answered

#: the answer that leaves a key as the preset has it
KEPT = "preset"


def _presets() -> list[str]:
    from conespot.scene.document import shipped

    return list(shipped("scene", "presets"))


def _rigs() -> list[str]:
    from conespot.scene.spotlights import RIGS

    return list(RIGS)


def _trajectories() -> list[str]:
    from conespot.scene.trajectory import KINDS

    return [kind for kind in KINDS if kind != "csv"]


def _lights() -> list[str]:
    from conespot.scene.illumination import LIGHTS

    return [KEPT, *LIGHTS]


def _surfaces() -> list[str]:
    from conespot.scene.surface import SURFACES

    return [KEPT, *SURFACES]


def _localizers() -> list[str]:
    from conespot.localize.locate import localizer_names

    return localizer_names()


def _power(text: str) -> str:
    from conespot.scene.quantity import parse_quantity

    if text != KEPT and parse_quantity(text, "power", bare=False) <= 0.0:
        raise ValueError(f"a power must be above 0 W, got {text!r}")
    return text


def _resolution(text: str) -> str:
    from pydantic import TypeAdapter, ValidationError

    from conespot.scene.resolution import Resolution

    if text == KEPT:
        return KEPT
    try:
        found = TypeAdapter[int | tuple[int, int]](Resolution).validate_python(text)
    except ValidationError:
        raise ValueError(f"expected pixels a side such as 1000, or 1920x1080, got {text!r}") from None
    return f"[{found[0]}, {found[1]}]" if isinstance(found, tuple) else str(found)


def _poses(text: str) -> str:
    if not (text.isascii() and text.isdecimal() and len(text) < 7 and 1 <= int(text) <= 100_000):
        raise ValueError(f"expected a whole number from 1 to 100000, got {text!r}")
    return str(int(text))


def _quick(so_far: Mapping[str, str]) -> str:
    """Small square frames for a first look, where the preset's own are square."""
    return "1000" if so_far["preset"].startswith("paper") else KEPT


QUESTIONS = (
    Question("preset", "which experiment to begin with", "paper-code", choices=_presets),
    Question("resolution", "pixels a side of a frame, or 1920x1080", _quick, check=_resolution, metavar="PX"),
    Question("spotlights", "how many cones of light the needle carries", "single", choices=_rigs, several=True),
    Question("trajectory", "the way of the needle's tip", "helix", choices=_trajectories, several=True),
    Question("poses", "how many places on that way", "20", check=_poses, metavar="N"),
    Question("power", "power of a spotlight, such as 0.25 W", KEPT, check=_power, several=True),
    Question("light", "light of the spotlights", KEPT, choices=_lights, several=True),
    Question("surface", "relief of the retina", KEPT, choices=_surfaces, several=True),
    Question("localizers", "what finds the needle in a frame", "paper-code, cone", choices=_localizers, several=True),
)
#: the key that each answer is written to, and what stands beside it
_KEYS = {
    "spotlights": ("spotlights", "cones of light on one needle"),
    "power": ("power.value", "of one spotlight"),
    "light": ("illumination", "of the spotlights; `ambient` is the microscope's"),
    "surface": ("surface", "of the retina; `bumps` is the paper's deformation"),
}
_TRAJECTORIES = "also: spiral, line, grid, random, or {kind: csv, file: tips.csv}"


def write_campaign(path: Path, answers: Mapping[str, str]) -> int:
    """Write the campaign that the answers describe to a new file; how many rows it makes.

    Raises InputError, with nothing written, if the file is there, cannot be written, or the answers do not go together.
    """
    from conespot.campaigns.plan import make_plan

    return write_answered(path, _lines(path, answers), make_plan).rows


def _lines(path: Path, answers: Mapping[str, str]) -> Iterator[str]:
    """The lines of the file."""
    name = re.sub(r"[^A-Za-z0-9_.+-]+", "-", path.stem)[:80].lstrip("-_.+") or "campaign"
    several = {key for key in (*_KEYS, "trajectory") if "," in answers[key]}
    alone = [key for key in _KEYS if key not in several and answers[key] != KEPT]
    yield f"# Written by `campaign init`. Next: `campaign plan {path.name}`, then `campaign run {path.name}`."
    yield "# What is not said here comes from the preset, the convention of its watts too, which the plan states:"
    yield "# `isotropic` are Blender's, `flux` are those that leave the tip."
    yield f"name: {name} # the run goes to runs/{name}"
    yield "description: what this campaign is to find out"
    yield ""
    yield "scene:"
    yield f"  preset: {answers['preset']} # also: {', '.join(p for p in _presets() if p != answers['preset'])}"
    if answers["resolution"] != KEPT:
        yield f"  camera: {{resolution: {answers['resolution']}}} # [px] a side; fewer are quicker, and less exact"
    for key in alone:
        where, what = _KEYS[key]
        first, _, last = where.partition(".")
        yield f"  {first}: {f'{{{last}: {answers[key]}}}' if last else answers[key]} # {what}"
    if "trajectory" not in several:
        yield f"trajectory: {answers['trajectory']} # {_TRAJECTORIES}"
    yield f"poses: {answers['poses']} # places on the trajectory"
    yield f"localizers: [{answers['localizers']}] # `campaign list --localizers` says what each does"
    yield "seed: 1 # of every random number: the same seed gives the same rows"
    yield ""
    yield "# Every combination of what is swept is a case with tables and box plots of its own."
    yield f"sweep:{'' if several else ' {}'}"
    if "trajectory" in several:
        yield f"  trajectory: [{answers['trajectory']}] # {_TRAJECTORIES}"
    for key in (key for key in _KEYS if key in several):
        where, what = _KEYS[key]
        yield f"  scene.{where}: [{answers[key]}] # {what}"
    yield "# More that could be swept; take the # away, and the {} above if there is one:"
    for line in _MORE:
        if not any(line.startswith(f"scene.{_KEYS[key][0]}:") for key in several - {"trajectory"}):
            yield f"#  {line}"


_MORE = (
    "scene.power.value: [0.1 W, 0.25 W, 1 W]",
    "scene.surface: [smooth, bumps]",
    "scene.beam.half_angle: [9 deg, 12 deg] # half the cone's full angle",
    "knowledge.rcm_sigma: [0.05 mm, free] # how well cone and photometric may know the trocar",
)
