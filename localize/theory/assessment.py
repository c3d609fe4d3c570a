"""What the theory says of a scene, as plain records: Table I, bounds, error budget and design guidance.

Everything is asked for two tips of `TheorySettings`, `low` and `high`.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any, assert_never

import numpy as np

from conespot.localize.model.estimate import Estimate
from conespot.localize.model.knowns import Knowns
from conespot.localize.model.prior import prior_rows
from conespot.localize.theory.bounds import Bound, Electrons, cramer_rao, error_budget, smoothed_over
from conespot.localize.theory.conic import table_1
from conespot.localize.theory.design import beam_of, compare_designs
from conespot.localize.theory.settings import THEORY
from conespot.scene.document import InputError
from conespot.scene.emva import Emva
from conespot.scene.pose import Pose
from conespot.scene.scene import Scene
from conespot.scene.sensor import Linear, Srgb8
from conespot.scene.surface import bump_grid

Record = dict[str, str | float]

#: how well the bounds know the RCM [mm]
_RCM: dict[str, float | None] = {"free": None, "0.05 mm": 0.05, "exact": 0.0}
_TIPS = " and ".join(f"({', '.join(f'{c:g}' for c in tip)}) mm" for tip in (THEORY.low, THEORY.high))


@dataclass(frozen=True)
class Assessment:
    """Records `{column: value}` of the four tables; positions in um, angles in deg."""

    table_1: list[Record]
    bounds: list[Record]
    budget: list[Record]
    design: list[Record]
    assumes: str  #: the pixel model and what else every number rests on


def assess(scene: Scene) -> Assessment:
    """All of it. Raises InputError for a scene in which the tips are outside the eye or their patches not seen."""
    sensor = electrons_of(scene)
    try:
        return Assessment(
            _table_1(),
            _bounds(scene, sensor),
            _budget(scene, sensor),
            _design(scene, sensor),
            _assumes(scene, sensor),
        )
    except ValueError as error:
        raise InputError(f"scene: {error}; the theory is for tips at {_TIPS}") from None


def electrons_of(scene: Scene) -> Electrons:
    """The sensor of the bounds: an EMVA camera metered as it says, else 9000 e- over 15 e-.

    Without metering a camera's brightest light is taken to be 80 % of saturation.
    """
    match scene.sensor.camera:
        case Srgb8() | Linear():
            return Electrons()
        case Emva() as camera:
            level = camera.metering.level if camera.metering else THEORY.metered_level
            background = math.sqrt(camera.read_noise**2 + 1.0 / (12.0 * camera.gain**2))
            return Electrons(level * camera.saturation, background)
        case unknown:
            assert_never(unknown)


def tied(free: Bound, scene: Scene, pose: Pose, rcm_sigma_mm: float | None) -> Bound:
    """The bound once the RCM is known so well: its information adds to that of the image, nuisances taken out."""
    _, prior = prior_rows(Estimate(pose, scene), scene, Knowns(rcm_sigma_mm=rcm_sigma_mm))
    return Bound(np.asarray(np.linalg.inv(np.linalg.inv(free.covariance) + prior.T @ prior), float))


def _at(scene: Scene, *, resolution: int | None = None, softness: float | None = None) -> Scene:
    camera = scene.camera if resolution is None else scene.camera.with_columns(resolution)
    beam = scene.beam if softness is None else beam_of(scene.beam.half_angle, softness)
    return scene.model_copy(update={"camera": camera, "beam": beam})


def _table_1() -> list[Record]:
    return [
        {
            "half_angle_deg": row.half_angle_deg,
            "in_plane_um": row.in_plane_um,
            "distance_3d_um": row.distance_um,
            "volume_distance_3d_um": row.volume_distance_um,
        }
        for row in table_1()
    ]


def _bounds(scene: Scene, sensor: Electrons) -> list[Record]:
    found: list[Record] = []
    for resolution in THEORY.resolutions:
        for edge, softness in {"hard": 0.0, "soft": 1.0}.items():
            changed = _at(scene, resolution=resolution, softness=softness)
            for tip in (THEORY.low, THEORY.high):
                pose = changed.pose(np.array(tip))
                free = cramer_rao(changed, pose, sensor)
                for rcm, sigma in _RCM.items():
                    bound = tied(free, changed, pose, sigma)
                    values = {"position_um": 1e3 * bound.position_mm, "axis_deg": math.degrees(bound.axis_rad)}
                    found.append({"resolution_px": resolution, "edge": edge, "height_mm": tip[2], "rcm": rcm, **values})
    return found


def _budget(scene: Scene, sensor: Electrons) -> list[Record]:
    found: list[Record] = []
    for tip in (THEORY.low, THEORY.high):
        pose = scene.pose(np.array(tip))
        columns = scene.camera.shape[1]
        sides = (columns, columns // 2)
        free = [cramer_rao(_at(scene, resolution=side), pose, sensor) for side in sides]
        for rcm in ("free", "exact"):
            moves = [
                (part.quantity, *_in_degrees(part.quantity, part.tolerance), part.position_mm, part.axis_rad)
                for part in error_budget(scene, pose, rcm=rcm == "exact")
            ]
            here, coarse = (tied(bound, scene, pose, _RCM[rcm]) for bound in free)
            pixel = 1e3 * scene.camera.sensor_width / columns
            wider = (coarse.position_mm - here.position_mm, coarse.axis_rad - here.axis_rad)
            moves += [
                ("noise", 1.0, "x the sensor's", here.position_mm, here.axis_rad),
                ("pixel_size", pixel, "um", *wider),
                ("unknown_bumps", 0.1, "mm", *_bumps(scene, tip[2], rcm=rcm == "exact")),
            ]
            for name, tolerance, unit, position, axis in moves:
                um, deg = 1e3 * position, math.degrees(axis)
                row: Record = {"quantity": name, "tolerance": tolerance, "unit": unit, "position_um": um}
                per = {"position_um_per_unit": um / tolerance, "axis_deg_per_unit": deg / tolerance}
                found.append({"height_mm": tip[2], "rcm": rcm, **row, "axis_deg": deg, **per})
    return found


def _in_degrees(quantity: str, tolerance: float) -> tuple[float, str]:
    return (math.degrees(tolerance), "deg") if quantity == "half_angle" else (tolerance, "mm")


def _bumps(scene: Scene, height: float, *, rcm: bool) -> tuple[float, float]:
    """What the paper's bumps do to a fit that does not know them, root mean square over a ring of tips [mm, rad]."""
    bumpy = scene.model_copy(update={"surface": bump_grid()})
    turns = 2.0 * math.pi * np.arange(THEORY.bump_tips) / THEORY.bump_tips
    tips = [np.array([THEORY.bump_ring * math.cos(t), THEORY.bump_ring * math.sin(t), height]) for t in turns]
    steps = np.array([smoothed_over(bumpy, scene.pose(tip), rcm=rcm) for tip in tips])
    return float(np.sqrt(np.mean(steps[:, :3] ** 2) * 3.0)), float(np.sqrt(np.mean(steps[:, 3:5] ** 2) * 2.0))


def _design(scene: Scene, sensor: Electrons) -> list[Record]:
    coarse = _at(scene, resolution=min(scene.camera.shape[1], THEORY.design_resolution))
    rigs = [(n, spread) for n in THEORY.spotlights for spread in (THEORY.spreads if n > 1 else (0.0,))]
    varied: dict[str, dict[str, Any]] = {
        "half angle": {"half_angles": THEORY.half_angles},
        "edge softness": {"softness": THEORY.softness},
        "spotlights": {"rigs": rigs},
    }
    found: list[Record] = []
    for what, values in varied.items():
        for rcm in ("free", "exact"):
            known = Knowns(rcm_sigma_mm=_RCM[rcm])
            for design in compare_designs(coarse, (THEORY.low, THEORY.high), sensor=sensor, knowns=known, **values):
                row: Record = {"half_angle_deg": math.degrees(design.half_angle), "softness": design.softness}
                row |= {"spotlights": design.spotlights, "spread_deg": math.degrees(design.spread)}
                errors = {"position_um": 1e3 * design.position_mm, "axis_deg": math.degrees(design.axis_rad)}
                found.append({"varied": what, "rcm": rcm, **row, **errors})
    return found


def _assumes(scene: Scene, sensor: Electrons) -> str:
    """What the numbers rest on, for people."""
    camera, peak, background = scene.camera, f"{sensor.peak:.0f}", f"{sensor.background:.3g}"
    return (
        "Square pixels that average exactly, and the scene's own blur, of a width that is not known; Gaussian noise of"
        f" variance signal + ({background} e-)^2, independent between pixels; {peak} e- where the patch is brightest;"
        " albedo uniform or known, gain and offset unknown. The budget is of an outline fit that weighs all points"
        f" alike; bumps are those of the paper, averaged over tips {THEORY.bump_ring:g} mm aside. Designs have the same"
        f" {peak} e- each, at"
        f" {min(camera.shape[1], THEORY.design_resolution)} px; a beam other than `cycles` counts as hard there. Eye"
        f" of {scene.eye.radius:g} mm, camera {camera.height:g} mm above the pole, half angle"
        f" {math.degrees(scene.beam.half_angle):g} deg, tips at {_TIPS}."
    )
