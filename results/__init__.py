"""Results: rows to box statistics, tables, figures and a report. Reads files only, so anybody's run will do.

Loaded when first asked for, so that who only reads `conespot.results.columns` waits for no plotting library.
"""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from conespot.results.run import Run, load_run
    from conespot.results.writing import tables_text, write_results

_HOMES = {"Run": "run", "load_run": "run", "tables_text": "writing", "write_results": "writing"}

__all__ = ["Run", "load_run", "tables_text", "write_results"]


def __getattr__(name: str) -> object:
    if name not in _HOMES:
        raise AttributeError(f"module 'conespot.results' has no attribute {name!r}")
    return getattr(importlib.import_module(f"conespot.results.{_HOMES[name]}"), name)
