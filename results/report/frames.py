"""A frame's name in the page: what ties a point of a chart to the picture that is kept of it."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any


def frame_of(row: Mapping[Any, Any]) -> str:
    """The name of a row's frame as a localizer saw it."""
    return f"{row['case']}/{row['localizer']}/{row['pose']}"
