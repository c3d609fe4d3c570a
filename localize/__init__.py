"""Where the instrument is: numpy, scipy and OpenCV. Never the truth, and works without Mitsuba installed."""

from localize.locate import LOCALIZERS, locate
from localize.outcome import Localization, LocalizationFailure

__all__ = ["LOCALIZERS", "Localization", "LocalizationFailure", "locate"]
