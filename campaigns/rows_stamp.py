"""Which journal the rows of a run were written from, and by which program: rows that follow from it need no renewal.

`rows.json` names, by their digests, the journal and the campaign that rows were made of, the files that came out, and
the software that made them. Where all of it is still so, making them again would give the same bytes; of a million
rows that spares a minute. It proves nothing to others, whom `campaign verify` serves.
"""

from __future__ import annotations

import contextlib
import hashlib
import json
from pathlib import Path

from conespot.campaigns.journal import FILE as JOURNAL
from conespot.campaigns.plain_file import open_plain
from conespot.campaigns.scores import FOLDER as SCORES
from conespot.campaigns.software import software
from conespot.scene.atomic import write_atomically

FILE = "rows.json"
_MOST_BYTES = 10_000
_ROWS = ("errors.csv", "errors.parquet")
_CHUNK = 1 << 20


def stamp(folder: Path, journal_bytes: int) -> None:
    """Note that the rows in a run folder follow from that much of its journal. Raises InputError."""
    said = _said(folder, journal_bytes)
    if said is not None:
        write_atomically(folder / FILE, json.dumps(said).encode())


def follows(folder: Path) -> bool:
    """Whether the rows in a run folder are what its journal says, as this program writes it."""
    try:
        with open_plain(folder / FILE) as stream:
            known = json.loads(stream.read(_MOST_BYTES))
        size = (folder / JOURNAL).stat().st_size
    except (OSError, ValueError, RecursionError):
        return False
    return bool(known == _said(folder, size))


def forget(folder: Path) -> None:
    """Take the note back, before rows are written that it does not know of."""
    with contextlib.suppress(OSError):
        (folder / FILE).unlink(missing_ok=True)


def _said(folder: Path, journal_bytes: int) -> dict[str, object] | None:
    """None where something else has a part in the rows, or a file cannot be read."""
    if (folder / SCORES).exists():
        return None
    try:
        files = {name: _digest(folder / name) for name in ("campaign.yaml", *_ROWS)}
        files[JOURNAL] = _digest(folder / JOURNAL, journal_bytes)
    except OSError:
        return None
    return {"software": software(), "journal_bytes": journal_bytes, "sha256": files}


def _digest(path: Path, most: int | None = None) -> str:
    """Of the first `most` bytes of a file."""
    found = hashlib.sha256()
    with open_plain(path) as stream:
        left = most
        while chunk := stream.read(_CHUNK if left is None else min(_CHUNK, left)):
            found.update(chunk)
            left = None if left is None else left - len(chunk)
    return found.hexdigest()
