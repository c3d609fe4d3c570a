"""The experiment, described: frozen models and closed-form geometry. No images, no Mitsuba."""

from scene.camera import Camera
from scene.document import InputError
from scene.eye import Eye
from scene.pose import Pose
from scene.scene import Scene, load_scene

__all__ = ["Camera", "Eye", "InputError", "Pose", "Scene", "load_scene"]
