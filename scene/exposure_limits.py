"""Retinal exposure to spotlights and microscope. A research estimate, not a safety assessment.

Irradiances are held to ISO 15004-2:2007, Group 1, with its weights (Annex A, Table A.1) and its limits halved, as that
edition asks for endoilluminators; the 2024 edition, which could not be read, supersedes it. The photochemical dose is
that of ICNIRP (Health Physics 105:74, 2013), Eq. 18, for an aphakic eye: 1.0 MJ m-2 sr-1 seen through a pupil of 3 mm,
with a focal length of 17 mm and 0.9 transmitted.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from conespot.scene.pose import Pose, cone_rays
from conespot.scene.scene import Scene
from conespot.scene.spectrum import Curve, mean_of, tabulated
from conespot.scene.spotlights import spotlight_axes

LABEL = "limits: ISO 15004-2, 2007 edition; dose: ICNIRP 2013, aphakic; research estimate, not a safety assessment"
#: Group 1 limits [W/m2], halved for endoilluminators: A-weighted 220 uW/cm2, R-weighted 0.7 W/cm2
PHOTOCHEMICAL_LIMIT = 2.2 / 2.0
THERMAL_LIMIT = 7000.0 / 2.0
#: A-weighted radiant exposure of the retina [J/m2]: 1.0 MJ m-2 sr-1 through the pupil's solid angle
PHOTOCHEMICAL_DOSE = 1.0e6 * 0.9 * (math.pi / 4.0) * (3.0 / 17.0) ** 2


@dataclass(frozen=True)
class RetinalExposure:
    """Peak irradiance on the retina [W/m2], unweighted and weighted, and what follows from it."""

    irradiance: float
    photochemical: float  #: A-weighted (aphakic), 305 to 700 nm
    thermal: float  #: R-weighted, 380 to 1400 nm

    @property
    def photochemical_ratio(self) -> float:
        """A-weighted irradiance over its limit; above 1 the limit is exceeded."""
        return self.photochemical / PHOTOCHEMICAL_LIMIT

    @property
    def thermal_ratio(self) -> float:
        """R-weighted irradiance over its limit; above 1 the limit is exceeded."""
        return self.thermal / THERMAL_LIMIT

    @property
    def seconds_to_dose(self) -> float:
        """Time on one place until the A-weighted exposure is ICNIRP's dose [s]; infinite without any such light."""
        return PHOTOCHEMICAL_DOSE / self.photochemical if self.photochemical > 0.0 else math.inf

    @property
    def sentence(self) -> str:
        """One line for a plan or a report of a scene's exposure, with its label."""
        minutes = self.seconds_to_dose / 60.0
        dose = f"{PHOTOCHEMICAL_DOSE / 1e4:.2g} J/cm2 A-weighted"
        time = f"{dose} after {minutes:.3g} min, half of it after {minutes / 2.0:.3g}"
        if math.isinf(minutes):
            time = "no A-weighted light"
        return (
            f"peak retinal irradiance, microscope included, {self.irradiance / 10.0:.3g} mW/cm2; "
            f"A-weighted {self.photochemical / 10.0:.3g} "
            f"mW/cm2 ({self.photochemical_ratio:.3g} x limit), R-weighted {self.thermal / 10.0:.3g} mW/cm2 "
            f"({self.thermal_ratio:.3g} x limit); {time} ({LABEL})"
        )


def hazard_fractions(spectrum: Curve) -> tuple[float, float]:
    """A- and R-weighted power over power of a light. Wavelengths where a weight is not tabulated do not count."""
    photochemical = tabulated("iso15004_2_2007_weights", "A_aphakic").cut(305.0, 700.0)
    return mean_of(spectrum, photochemical), mean_of(spectrum, tabulated("iso15004_2_2007_weights", "R_thermal"))


def exposure(irradiance: float, spectrum: Curve) -> RetinalExposure:
    """The exposure of an irradiance [W/m2] of a light of this spectrum.

    >>> from conespot.scene.illumination import Line
    >>> exposure(1000.0, Line(wavelength=850.0).spectrum).seconds_to_dose  # no photochemical hazard in the infrared
    inf
    """
    photochemical, thermal = hazard_fractions(spectrum)
    return RetinalExposure(irradiance, irradiance * photochemical, irradiance * thermal)


def together(*exposures: RetinalExposure) -> RetinalExposure:
    """The exposure to several lights on one place."""
    parts = [(e.irradiance, e.photochemical, e.thermal) for e in exposures]
    return RetinalExposure(*(sum(values) for values in zip(*parts, strict=True)))


def disc_irradiance(flux: float, half_angle: float, distance: float) -> float:
    """Mean irradiance [W/m2] of a flux [W] on the disc a cone cuts from a plane `distance` [mm] away, across it.

    >>> round(disc_irradiance(1e-3, math.atan(0.5), 2.0), 3)  # 1 mW over a radius of 1 mm
    318.31
    """
    radius = distance * 1e-3 * math.tan(half_angle)
    return flux / (math.pi * radius * radius)


def peak_irradiance(scene: Scene, pose: Pose, power_w: float) -> float:
    """Largest irradiance [W/m2] on the retina of all spotlights together, each at `power_w`, from one pose.

    Searched on a polar grid of directions in each cone; spotlights that overlap add up. Bumps are included.
    """
    axes = spotlight_axes(pose, scene.spotlights)
    intensity = scene.power.model_copy(update={"value": power_w}).axial_intensity(scene.beam)
    points = np.concatenate([_cone_points(scene, pose, axis) for axis in axes])
    points = points[np.all(np.isfinite(points), axis=-1)]
    return float(np.max(_irradiance(scene, pose, axes, points), initial=0.0) * intensity)


def scene_exposure(scene: Scene, poses: list[Pose], power_w: float) -> RetinalExposure:
    """The worst exposure over poses, with each spotlight at `power_w` [W] in the scene's convention.

    The microscope's light is added as where it falls straight on the retina.
    """
    worst = max((peak_irradiance(scene, pose, power_w) for pose in poses), default=0.0)
    microscope = exposure(scene.ambient.irradiance, scene.ambient.illumination.spectrum)
    return together(exposure(worst, scene.illumination.spectrum), microscope)


def _cone_points(scene: Scene, pose: Pose, axis: ArrayLike) -> NDArray[np.float64]:
    tilt = np.linspace(0.0, 1.0, 13) * scene.beam.half_angle
    phi = np.linspace(0.0, 2.0 * math.pi, 24, endpoint=False)
    rays = cone_rays(np.asarray(axis, float), *(m.ravel() for m in np.meshgrid(tilt, phi)))
    return scene.surface.intersect(scene.eye, pose.apex, rays)


def _irradiance(
    scene: Scene, pose: Pose, axes: NDArray[np.float64], points: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Irradiance [1/m2] of all spotlights of axial intensity 1 W/sr at surface points `[N, 3]` [mm]."""
    offset = points - pose.apex
    distance = np.linalg.norm(offset, axis=-1)
    ray = offset / distance[:, None]
    outward = points - scene.eye.centre
    normal = scene.surface.normals(scene.eye, outward / np.linalg.norm(outward, axis=-1, keepdims=True))
    cosine = np.maximum(-np.sum(normal * ray, axis=-1), 0.0)
    relative = sum(scene.beam.intensity(np.clip(ray @ axis, -1.0, 1.0)) for axis in axes)
    return np.asarray(relative * cosine / (distance * 1e-3) ** 2)
