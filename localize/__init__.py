"""Where the instrument is: numpy, scipy and OpenCV. Never the truth, and works without Mitsuba installed."""

from localize.locate import LOCALIZERS, locate
from localize.noise import SensorNoise
from localize.outcome import Localization, LocalizationFailure
from localize.prior import Knowns

__all__ = ["LOCALIZERS", "Knowns", "Localization", "LocalizationFailure", "SensorNoise", "locate"]
