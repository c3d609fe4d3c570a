"""`campaign pack`: a run folder as one archive that a reviewer can check, and run again, anywhere."""

from __future__ import annotations

import datetime
import os
from collections.abc import Callable
from pathlib import Path
from typing import Any

from conespot.campaigns import archive, crate
from conespot.campaigns.journal import FILE as JOURNAL
from conespot.campaigns.lock import alone
from conespot.campaigns.plan import make_plan
from conespot.campaigns.rows_stamp import FILE as STAMP
from conespot.campaigns.schema import read_campaign
from conespot.campaigns.software import software
from conespot.campaigns.standing import FILE as STANDING
from conespot.campaigns.store import goes_on, look_into, read_begun_with
from conespot.results.makers import read_makers
from conespot.scene import InputError
from conespot.scene.atomic import replacing
from conespot.scene.document import dump, read_document, shipped

#: within an archive, where the files lie that a campaign names
INPUTS = "inputs"
#: keys whose value may be the name of a file
_FILES = ("file", "calibration", "preset", "scene")


def pack(folder: Path, out: Path | None) -> str:
    """Write a run folder into an archive (by default beside it, with .zip behind its name); what to say of it.

    Raises InputError for a folder that is no run of this version, holds links, or whose files cannot be read.
    """
    if not (folder / "campaign.yaml").is_file() or not (folder / JOURNAL).is_file():
        raise InputError(f"{folder}: is no run folder; `campaign run NAME --out {folder}` makes one")
    begun_with = read_begun_with(folder)
    if not goes_on(begun_with):
        raise InputError(f"{folder}: was begun by conespot {begun_with.get('conespot')}, which named cases otherwise")
    target = out or folder.resolve().with_suffix(folder.suffix + ".zip")
    with alone(folder):
        plan = make_plan(read_campaign(str(folder / "campaign.yaml")))
        with look_into(folder, plan) as store:
            damage, kept = store.damage, len(store.entries)
        if damage:
            raise InputError(f"{damage[0]}; run the campaign again before it is packed")
        left_out = {STANDING, STAMP} | ({target.name} if target.resolve().parent == folder.resolve() else set())
        files: dict[str, bytes | Path] = {
            name: path for name, path in archive.plain_files(folder) if name not in left_out
        }
        inputs: dict[str, Path] = {}
        data = read_document(folder / "campaign.yaml").data
        moved = with_files(data, lambda name: _taken(name, inputs))
        if inputs:
            files["campaign.yaml"] = dump(moved).encode()
            files |= {f"{INPUTS}/{name}": path for name, path in inputs.items()}
        sizes = {name: len(f) if isinstance(f, bytes) else f.stat().st_size for name, f in files.items()}
        date = datetime.datetime.fromtimestamp(os.stat(folder / JOURNAL).st_mtime, datetime.UTC).date().isoformat()
        made = [f"{count} poses: {maker}" for maker, count in read_makers(folder).items()]
        campaign = plan.campaign
        files[crate.FILE] = crate.metadata(campaign.name, campaign.description, date, sizes, software(), made)
        with replacing(target) as stream:
            archive.write_archive(stream, files)
    poses = sum(len(group.positions) for group in plan.groups)
    some = "" if kept == poses else f", {kept} of {poses} poses are finished"
    digest = archive.Archive(target).digest()
    return f"{target}: {len(files) + 1} files, {target.stat().st_size / 1e6:.1f} MB{some}\nsha256 {digest}"


def with_files(data: Any, moved: Callable[[str], str]) -> Any:
    """Plain data of a campaign, with every file that it names called what `moved` says."""
    if isinstance(data, list):
        return [with_files(item, moved) for item in data]
    if not isinstance(data, dict):
        return data
    found = {}
    for key, value in data.items():
        named = str(key).rpartition(".")[2] in _FILES
        if named and isinstance(value, str) and not _is_shipped(value):
            value = moved(value)
        elif named and isinstance(value, list):
            value = [moved(v) if isinstance(v, str) and not _is_shipped(v) else with_files(v, moved) for v in value]
        else:
            value = with_files(value, moved)
        found[key] = value
    return found


def _is_shipped(name: str) -> bool:
    return name.removesuffix(".yaml") in shipped("scene", "presets")


def _taken(name: str, inputs: dict[str, Path]) -> str:
    """The place within the archive of a file that a campaign names, which is added to its `inputs`."""
    path = Path(name)
    if not path.is_file():
        raise InputError(f"{name}: is named by the campaign and cannot be read; put it back before the run is packed")
    known = {place: inner for inner, place in inputs.items()}
    if path not in known:
        inner = path.name if path.name not in inputs else f"{len(inputs)}-{path.name}"
        known[path] = inner
        inputs[inner] = path
    return f"{INPUTS}/{known[path]}"
