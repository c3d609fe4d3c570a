"""Where the instrument is: numpy, scipy and OpenCV. Never the truth, and works without Mitsuba installed."""

from conespot.localize.image import Reference
from conespot.localize.locate import ESTIMATORS, LOCALIZERS, locate
from conespot.localize.model.noise import SensorNoise
from conespot.localize.model.prior import Knowns
from conespot.localize.outcome import Localization, LocalizationFailure

__all__ = [
    "ESTIMATORS",
    "LOCALIZERS",
    "Knowns",
    "Localization",
    "LocalizationFailure",
    "Reference",
    "SensorNoise",
    "locate",
]
