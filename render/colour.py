"""What a human would see: XYZ of the CIE 1931 observer from the spectral renderer, and sRGB for previews."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from conespot.render.renderer import Renderer
from conespot.scene import Pose, Scene
from conespot.scene.spectrum import Curve

_NAMES = ("x_bar", "y_bar", "z_bar")
#: no preview is brightened beyond this white [W m-2 sr-1], 7 cd/m2: an infrared scene is dark, as to the eye
DARKEST_WHITE = 0.01


def observer() -> dict[str, Curve]:
    """The colour matching functions of the CIE 1931 2 degree standard observer, 360 to 830 nm (colour-science)."""
    import colour

    functions: Any = colour.MSDS_CMFS["CIE 1931 2 Degree Standard Observer"]
    wavelengths = np.asarray(functions.wavelengths, float)
    return {name: Curve(wavelengths, np.asarray(functions.values, float)[:, i]) for i, name in enumerate(_NAMES)}


def render_xyz(scene: Scene, pose: Pose, power_w: float, *, samples: int = 16) -> NDArray[np.float32]:
    """The frame `[H, W, 3]` as the observer's X, Y, Z [W m-2 sr-1], spotlights at `power_w` [W] and ambient light."""
    renderer = Renderer(scene, samples=samples, responses=observer())
    xyz = renderer.background(pose).copy()
    for k in range(len(scene.spotlights)):
        tile = renderer.tile(pose, k, seed=k)
        xyz[tile.crop.slices] += np.float32(power_w) * tile.radiance
        if tile.glare is not None:
            xyz += np.float32(power_w) * tile.glare
    return xyz


def to_srgb(xyz: NDArray[Any], white: float) -> NDArray[np.uint8]:
    """sRGB `[H, W, 3]` of X, Y, Z `[H, W, 3]`; Y = `white` is white, colours outside the gamut are clipped.

    No chromatic adaptation: a white LED looks as warm as it is beside daylight.
    """
    import colour

    rgb = colour.XYZ_to_sRGB(np.asarray(xyz, float) / white)
    return np.rint(255.0 * np.clip(rgb, 0.0, 1.0)).astype(np.uint8)


def colour_preview(scene: Scene, pose: Pose, power_w: float, *, percentile: float = 99.0) -> NDArray[np.uint8]:
    """A colour picture `[H, W, 3]`, white at a percentile of its luminance; dark where the eye would see nothing."""
    xyz = render_xyz(scene, pose, power_w)
    return to_srgb(xyz, max(float(np.percentile(xyz[..., 1], percentile)), DARKEST_WHITE))
