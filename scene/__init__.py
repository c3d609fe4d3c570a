"""The experiment, described: frozen models and closed-form geometry. No images, no Mitsuba."""

from conespot.scene.camera import Camera
from conespot.scene.document import InputError
from conespot.scene.eye import Eye
from conespot.scene.pose import Pose
from conespot.scene.scene import Scene, load_scene

__all__ = ["Camera", "Eye", "InputError", "Pose", "Scene", "load_scene"]
