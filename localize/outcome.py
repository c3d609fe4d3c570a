"""What a localizer answers: a localization, or the reason why there is none."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from conespot.scene.camera import Camera
from conespot.scene.scene import Scene

Array = NDArray[np.float64]

#: reasons of more than one stage; a reason is counted by its text, so it carries no numbers
COVERED: Final = "too little of the patch is in the frame"
UNCERTAIN: Final = "too uncertain: the patch and what is known do not hold the tip within the limit"
FEW_PIXELS: Final = "the patch is too few pixels wide: a tip so near the wall needs a camera that resolves more"
OUTSIDE: Final = "the tip would be outside the eye"
#: reasons of the frame itself
COMPRESSED: Final = "the frame went through JPEG, of which the scene's sensor says nothing: state a recorded one"
GLOWS: Final = (
    "the patch glows beyond its rim, as light from under the retina does, and does not fit what is usual of that: give "
    "the scene's retina a spread"
)
OTHER_LIGHT: Final = (
    "something bright and round stands out, but has not the outline of the scene's beam: beam.kind is cycles or linear "
    "where the light fades out softly, hard where it ends sharply, and camera.lens says what blurs it"
)
OUTSHONE: Final = (
    "something far brighter than what looks like the patch is elsewhere in the frame: "
    "if that is the spotlight, state what blurs it (camera.lens, motion) or its beam"
)
BELOW_BLACK: Final = (
    "the frame is darker than no light: the black of the scene's sensor is too high (its black_level; or of a recorder,"
    " the range limited in place of full)"
)
WRONG_NOISE: Final = (
    "the frame's noise does not grow with its light as the scene's sensor says: its values have gamma (srgb8, or"
    " recorded), or its read_noise is told too small"
)
DISC_UNDER_IT: Final = (
    "an optic disc about as large as the patch lies under it, and its rim may pass for the light's end: give a "
    "reference frame without spotlights"
)
#: reasons of the published methods
NOTHING_FOUND: Final = "nothing found: no patch stands out of the background"
NO_LIGHT: Final = "no light of a spotlight: nothing is twice as bright as its surroundings"
FEWER_PATCHES: Final = "fewer patches than spotlights"
CUT_BY_BORDER: Final = "patch cut by the image border"
NO_INTERSECTION: Final = "no real intersection: the outline leaves the eye"
NO_ELLIPSE: Final = "no ellipse fits the outline"
NEAR_CIRCLE: Final = "near-circle: the outline does not tell where the cone leans"


@dataclass(frozen=True)
class Distance:
    """How far the tip is from the wall [mm]: along the needle's axis, and from its nearest point; negative behind it.

    The standard deviations [mm] hold the pose's, its correlation with what else the fit left free, and how well the
    wall is known; None where the localizer states no covariance. `source_mm` is by how much a source that is no point
    may pass for one that is farther away: on a clipped patch its width adds to the cone's. Research, no safety device.
    """

    along_mm: float
    nearest_mm: float
    sigma_along_mm: float | None = None
    sigma_nearest_mm: float | None = None
    source_mm: float = 0.0

    def beyond(self, sigmas: float) -> float | None:
        """What the nearest distance is beyond [mm], so many standard deviations aside; None without one."""
        if self.sigma_nearest_mm is None:
            return None
        return self.nearest_mm - self.source_mm - sigmas * self.sigma_nearest_mm


@dataclass(frozen=True, eq=False)
class Localization:
    """Where the tip is and where the needle points; truthy.

    `apex_mm` is the tip `[3]` [mm] and `axis` the needle's unit axis into the light `[3]`. `covariance`, where the
    localizer knows it, is `[5, 5]` over the apex [mm] and the axis's components [rad] along the first two columns
    of `Pose.rotation()`, or `[6, 6]` with the roll [rad] behind them. `spread_mm` is the root mean square distance
    of several spotlights' positions from their mean, None where there was one estimate. `roll` [rad] is as in `Pose`,
    None for localizers that do not measure it. `distance` is the tip's from the wall, which `locate` adds. `camera` is
    the one that the answer belongs to, where the fit found it to stand otherwise than told. `likelihood` is the
    log-likelihood of an edge's bins, one in the mean: it compares answers to one frame, and is None where the fit was
    no band of bins.
    """

    apex_mm: Array
    axis: Array
    covariance: Array | None = None
    spread_mm: float | None = None
    roll: float | None = None
    distance: Distance | None = None
    camera: Camera | None = None
    likelihood: float | None = None

    def seen_in(self, scene: Scene) -> Scene:
        """The scene in which its outlines lie where the frame has them."""
        return scene if self.camera is None else scene.model_copy(update={"camera": self.camera})


@dataclass(frozen=True)
class LocalizationFailure:
    """The frame cannot be localized; falsy. `reason` is a short sentence, the same for every frame of its kind."""

    reason: str

    def __bool__(self) -> bool:
        return False


Outcome = Localization | LocalizationFailure
