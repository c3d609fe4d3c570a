"""What a row is made with, beside its campaign: versions, Mitsuba's variant, the machine."""

from __future__ import annotations

import contextlib
import functools
import importlib.metadata
import platform
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING

from conespot.scene.identity import SCHEMA

if TYPE_CHECKING:
    from conespot.campaigns.plan import Plan
    from conespot.render.kernel import Kernel

#: all that an answer may depend on
PACKAGES = ("conespot", "mitsuba", "drjit", "numpy", "scipy", "opencv-python-headless", "karellen-llvm-core")
_BETWEEN = ", "


def made_with(plan: Plan) -> dict[str, str]:
    """What identifies a run and what began it: identity and its schema, versions, Python, platform."""
    return {"identity": plan.identity, "schema": str(SCHEMA), **_versions()}


def maker(kernel: Kernel | None = None) -> str:
    """What this process makes rows with, in a line of names and values; with the `kernel` that renders, if one does.

    The same rows come out to the byte where this line is the same, else within the renderer's tolerance.
    """
    told = _versions() | {"cpu": _cpu()}
    if kernel is not None:
        told = {"variant": kernel.variant, **told}
        if kernel.variant.startswith("llvm"):
            told["llvm"] = str(kernel.llvm_version or "unknown")
    return in_a_line(told)


def in_a_line(told: Mapping[str, str]) -> str:
    """Names and values as a maker's line has them."""
    return _BETWEEN.join(f"{name} {value.replace(',', ' ')}" for name, value in told.items())[:500]


class Makers:
    """Who made the rows of a run so far, to say when another one joins."""

    def __init__(self, known: Iterable[str]) -> None:
        self._known = set(known)
        self._said: set[str] = set()

    def meet(self, line: str) -> str | None:
        """A maker's row comes in: how it differs from the others so far, if that was not said; None if it does not."""
        sentence = self.expect(line)
        self._known.add(line)
        return sentence

    def expect(self, line: str) -> str | None:
        """What `meet` says, before there is a row: what is not known yet, as the variant, does not differ."""
        if line in self._known:
            return None
        mine = items(line)
        others: dict[str, set[str]] = {}
        for known in self._known:
            for name, value in items(known).items():
                if value != mine.get(name, value) and f"{name} {mine[name]}" not in self._said:
                    others.setdefault(name, set()).add(value)
        if not others:
            return None
        now = [f"{name} {mine[name]}" for name in others]
        self._said.update(now)
        before = [f"{name} {' and '.join(sorted(values))}" for name, values in others.items()]
        return (
            f"finished poses were made with {_BETWEEN.join(before)}, new ones with {_BETWEEN.join(now)}; "
            "rows of both are mixed from here on"
        )


@functools.cache
def _versions() -> dict[str, str]:
    versions = {}
    for package in PACKAGES:
        with contextlib.suppress(importlib.metadata.PackageNotFoundError):
            versions[package] = importlib.metadata.version(package)
    return versions | {"python": platform.python_version(), "platform": f"{platform.system()} {platform.machine()}"}


@functools.cache
def _cpu() -> str:
    """The kind of processor, as the system calls it."""
    with contextlib.suppress(OSError, UnicodeDecodeError):
        for line in Path("/proc/cpuinfo").read_text("utf-8").splitlines():
            if line.startswith("model name"):
                return " ".join(line.partition(":")[2].split())
    return platform.processor() or "unknown"


def items(line: str) -> dict[str, str]:
    """The names and values of a maker's line; of a stranger's, whatever looks like one."""
    return {name: value for name, _, value in (item.partition(" ") for item in line.split(_BETWEEN))}
