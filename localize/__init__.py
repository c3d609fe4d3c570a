"""Where the instrument is: numpy, scipy and OpenCV. Never the truth, and works without Mitsuba installed."""

from localize.image import Reference
from localize.locate import ESTIMATORS, LOCALIZERS, locate
from localize.noise import SensorNoise
from localize.outcome import Localization, LocalizationFailure
from localize.prior import Knowns

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
