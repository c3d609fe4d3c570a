"""`campaign compare`: one light against another on the same poses, in one run or two."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from conespot.scene import InputError

#: two runs are what can differ; more would be a table nobody reads
MOST_RUNS = 8


def compare(folders: Sequence[Path], lights: str | None) -> str:
    """The comparison of run folders as text; `lights` is "REFERENCE,OTHER" or None for all. Raises InputError."""
    if len(folders) > MOST_RUNS:
        raise InputError(f"compare: {len(folders)} run folders are more than {MOST_RUNS}")
    names = [name.strip() for name in lights.split(",")] if lights else []
    if names and (len(names) != 2 or not all(names) or names[0] == names[1]):
        raise InputError(f"--lights {lights}: write the reference and another light, such as led-b3,ir850")
    from conespot.results.compare_runs import compare_runs

    return compare_runs(folders, *names)
