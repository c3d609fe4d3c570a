"""What the camera sees. The only room that uses Mitsuba, loaded when a `Renderer` is made."""

from conespot.render.exposure import Exposure, merged
from conespot.render.renderer import Renderer
from conespot.render.tile import Crop, Tile

__all__ = ["Crop", "Exposure", "Renderer", "Tile", "merged"]
