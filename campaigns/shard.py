"""A shard: the share of a campaign's poses that one job of an array measures, into a run folder of its own."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator
from dataclasses import dataclass

from conespot.campaigns.plan import Plan, Unit
from conespot.scene import InputError

_MOST = 10_000


@dataclass(frozen=True)
class Shard:
    """Number `number` of `count`, counted from 1."""

    number: int
    count: int

    @classmethod
    def of(cls, text: str) -> Shard:
        """The shard that "2/8" names. Raises InputError."""
        match = re.fullmatch(r"([0-9]{1,5})/([0-9]{1,5})", text, re.ASCII)
        if match is None or not 1 <= int(match[1]) <= int(match[2]) <= _MOST:
            raise InputError(f"--shard {text}: write I/N with 1 <= I <= N <= {_MOST}, such as 2/8")
        return cls(int(match[1]), int(match[2]))

    def __str__(self) -> str:
        return f"{self.number}/{self.count}"

    def units(self, plan: Plan) -> list[Unit]:
        """Its units of the plan, which follow each other scene by scene, so that shards of equal work load few.

        Raises InputError if there are more shards than the work can be shared among.
        """
        ordered = sorted(plan.units(), key=_scene_by_scene(plan))
        total = sum(_work(plan, unit) for unit in ordered)
        share = [unit for unit, before in _cumulated(plan, ordered) if before * self.count // total == self.number - 1]
        if not share:
            raise InputError(f"--shard {self}: no pose falls to it, since there are {len(ordered)}; use fewer shards")
        return share


def _scene_by_scene(plan: Plan) -> Callable[[Unit], int]:
    first: dict[str, int] = {}
    for group in plan.groups:
        first.setdefault(group.scene_key, len(first))
    return lambda unit: first[plan.groups[unit.group].scene_key]


def _work(plan: Plan, unit: Unit) -> int:
    return round(plan.groups[unit.group].work)


def _cumulated(plan: Plan, units: list[Unit]) -> Iterator[tuple[Unit, int]]:
    before = 0
    for unit in units:
        yield unit, before
        before += _work(plan, unit)
