"""The front door: what a user of the library needs, each loaded when it is first asked for.

`import conespot` takes milliseconds and needs no Mitsuba; only `Renderer` and `Exposure` load it.
"""

from __future__ import annotations

TYPE_CHECKING = False  # `typing` and `importlib` take longer to import than all that is done here
if TYPE_CHECKING:
    from conespot.campaigns.session import run_campaign
    from conespot.localize.calibration import calibrate
    from conespot.localize.distance import Alarm
    from conespot.localize.frames.reader import read_frames
    from conespot.localize.image import Reference
    from conespot.localize.locate import locate
    from conespot.localize.model.knowns import Knowns
    from conespot.localize.model.noise import SensorNoise
    from conespot.localize.outcome import Localization, LocalizationFailure
    from conespot.localize.sequence import locate_sequence
    from conespot.localize.together import locate_together
    from conespot.localize.tracking.tracker import Tracker
    from conespot.render.exposure import Exposure
    from conespot.render.renderer import Renderer
    from conespot.results.run import load_run
    from conespot.scene.document import InputError
    from conespot.scene.pose import Pose
    from conespot.scene.scene import Scene, load_scene

#: where each name lives
_HOMES = {
    "Alarm": "localize.distance",
    "Exposure": "render.exposure",
    "InputError": "scene.document",
    "Knowns": "localize.model.prior",
    "Localization": "localize.outcome",
    "LocalizationFailure": "localize.outcome",
    "Pose": "scene.pose",
    "Reference": "localize.image",
    "Renderer": "render.renderer",
    "Scene": "scene.scene",
    "SensorNoise": "localize.model.noise",
    "Tracker": "localize.tracking.tracker",
    "calibrate": "localize.calibration",
    "load_run": "results.run",
    "load_scene": "scene.scene",
    "locate": "localize.locate",
    "locate_sequence": "localize.sequence",
    "locate_together": "localize.together",
    "read_frames": "localize.frames.reader",
    "run_campaign": "campaigns.session",
}

__all__ = [
    "Alarm",
    "Exposure",
    "InputError",
    "Knowns",
    "Localization",
    "LocalizationFailure",
    "Pose",
    "Reference",
    "Renderer",
    "Scene",
    "SensorNoise",
    "Tracker",
    "calibrate",
    "load_run",
    "load_scene",
    "locate",
    "locate_sequence",
    "locate_together",
    "read_frames",
    "run_campaign",
]


def __getattr__(name: str) -> object:
    if name not in _HOMES:
        raise AttributeError(f"module 'conespot' has no attribute {name!r}")
    import importlib

    value = getattr(importlib.import_module(f"conespot.{_HOMES[name]}"), name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return __all__
