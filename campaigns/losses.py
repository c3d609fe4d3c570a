"""What becomes of units whose worker is lost: suspects are tried alone, and given up when they alone took two."""

from __future__ import annotations

from collections.abc import Callable, Sequence

from conespot.campaigns.ending import RunError
from conespot.campaigns.plan import Plan, Unit
from conespot.campaigns.row import Record
from conespot.campaigns.waiting import Waiting

#: workers lost in a row, with nothing ever finished, after which the machine is to blame and not the units: a unit is
#: tried twice, so two units that kill whoever takes them, and the machine may still be sound, lose as many
_HOPELESS = 4
REMEDY = "try `campaign doctor`"


class Losses:
    """Counts the workers that were lost, and whom to blame. `finished` is set once anything has been measured."""

    def __init__(self, plan: Plan, waiting: Waiting, note: Callable[[str], None]) -> None:
        self._plan, self._waiting, self._note = plan, waiting, note
        self._suspects: set[str] = set()
        self._count = 0
        self.finished = False

    def lost(self, units: Sequence[Unit], how: str) -> Record | None:
        """A worker was lost, in the way `how` says, with these units: they wait again, or one is given up in a record.

        Raises RunError if there is no hope for the others.
        """
        self._count += 1
        if self._count == _HOPELESS and not self.finished:
            raise RunError(f"no worker lives to finish anything, the last {how}; {REMEDY}")
        if len(units) > 1:
            self._note(f"a worker {how} with {len(units)} poses; trying each of them alone")
            self._waiting.put_back(units, alone=True)
            return None
        (unit,) = units
        if unit.key in self._suspects:
            self._note(f"a worker {how} at {self._plan.says(unit)} again; its frames are recorded as failed")
            return Record(unit=unit.key, error=f"the worker {how}, twice")
        self._note(f"a worker {how} at {self._plan.says(unit)}; trying that pose once more")
        self._suspects.add(unit.key)
        self._waiting.put_back(units, alone=True)
        return None
