"""Content addresses of what a campaign does: a case, the frames it looks at, the renderings they share, their scene.

They hold what differs from the defaults alone (`scene.identity`), so that a key that is new to a campaign, and has a
default, names nothing anew. A new key counts as one that changes what is rendered, unless it stands here.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

import numpy as np

from conespot.campaigns.schema import Campaign
from conespot.scene import Scene
from conespot.scene.identity import essence, identity

#: keys of a campaign that change nothing in what it finds, those that do so for some of its cases, and how they change
_NOTHING = {"name", "description", "expect", "made_with"}
_WHOLE = {"theory", "bounds", "frames"}
_FOUND = {"localizers", "knowledge"}  #: but no frame
_LOADED = {"scene", "samples", "edge_samples"}  #: before there is a pose


@dataclass(frozen=True)
class Addresses:
    """What names a combination's case, its frames, the group that shares its renderings, and the scene it loads."""

    case: str
    frame: str
    group: str
    scene: str

    @classmethod
    def of(cls, campaign: Campaign) -> Addresses:
        """The addresses of one combination."""
        shown = _shown(campaign)
        rendered = _shown(campaign.model_copy(update={"scene": at_one_watt(campaign.scene)}))
        return cls(
            case=identity("case", shown, campaign.knowledge),
            frame=identity("frame", shown),
            group=identity("group", rendered),
            scene=identity("scene", {key: value for key, value in rendered.items() if key in _LOADED}),
        )


def campaign_address(campaign: Campaign, cases: Iterable[tuple[str, tuple[str, ...]]]) -> str:
    """What names a campaign: its cases by key with their localizers, in any order, and what it asks for beside them."""
    parts = sorted((key, sorted(localizers)) for key, localizers in cases)
    asked = {key: value for key, value in essence(campaign).items() if key in _WHOLE}
    return identity("campaign", asked, {"cases": parts})


def places_address(campaign: Campaign) -> str:
    """What names the places a trajectory visits: the same in every scene, so that cases can be compared by pose."""
    return identity("places", campaign.trajectory, campaign.poses)


def course_seed(campaign: Campaign) -> int:
    """The seed of a motion along a trajectory: one for all its poses, however many, powers, cameras and localizers."""
    key = int(identity("course", campaign.trajectory), 16)
    return int(np.random.SeedSequence([campaign.seed, key]).generate_state(1)[0])


def at_one_watt(scene: Scene) -> Scene:
    """The scene as it is rendered: light is linear, so power is left to the exposure."""
    return scene.model_copy(update={"power": scene.power.model_copy(update={"value": 1.0})})


def _shown(campaign: Campaign) -> dict[str, Any]:
    """What a frame may show of the campaign."""
    return {k: v for k, v in essence(campaign).items() if k not in _NOTHING | _WHOLE | _FOUND}
