"""What the report calls things."""

from __future__ import annotations

_RIGS = {"single": "single spotlight", "triple": "three spotlights"}


def rig_words(rig: str) -> str:
    """A rig as readers call it."""
    return _RIGS.get(rig, rig)


def um(millimetres: float) -> str:
    """A length in micrometres, to three digits."""
    return f"{float(f'{1e3 * millimetres:.3g}'):,.15g} um"


def share(part: float, whole: float) -> str:
    """A share in percent, such as "3.4 %"."""
    return f"{100.0 * part / whole:.3g} %" if whole else "–"
