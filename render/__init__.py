"""What the camera sees. The only room that uses Mitsuba, loaded when a `Renderer` is made."""

from render.exposure import Exposure
from render.renderer import Renderer
from render.tile import Crop, Tile

__all__ = ["Crop", "Exposure", "Renderer", "Tile"]
