"""The plan of a run that was begun, from what its folder says of itself."""

from __future__ import annotations

from pathlib import Path

from conespot.campaigns.plan import Plan, make_plan
from conespot.campaigns.schema import read_campaign
from conespot.campaigns.store import goes_on, read_begun_with
from conespot.scene import InputError


def plan_of(folder: Path) -> Plan:
    """The plan of the run in a folder. Raises InputError for what is no run of this version."""
    if not (folder / "campaign.yaml").is_file():
        raise InputError(f"{folder}: no such run folder; `campaign run NAME --out {folder}` makes one")
    begun_with = read_begun_with(folder)
    if not goes_on(begun_with):
        raise InputError(f"{folder}: was begun by conespot {begun_with.get('conespot')}, which named cases otherwise")
    return make_plan(read_campaign(str(folder / "campaign.yaml")))
