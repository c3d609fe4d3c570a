"""Where the instrument is: numpy, scipy and OpenCV. Never the truth, and works without Mitsuba installed."""

from conespot.localize.image import Reference
from conespot.localize.localizer import Localizer
from conespot.localize.locate import LOCALIZERS, find_localizer, localizer_names, locate
from conespot.localize.model.knowns import Knowns
from conespot.localize.model.noise import SensorNoise
from conespot.localize.outcome import Localization, LocalizationFailure

__all__ = [
    "LOCALIZERS",
    "Knowns",
    "Localization",
    "LocalizationFailure",
    "Localizer",
    "Reference",
    "SensorNoise",
    "find_localizer",
    "localizer_names",
    "locate",
]
