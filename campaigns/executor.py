"""Who works a plan off: the one seam between what a campaign is and the machines it runs on."""

from __future__ import annotations

from collections.abc import Callable, Generator, Iterable
from pathlib import Path
from typing import Protocol

from conespot.campaigns.plan import Plan, Unit
from conespot.campaigns.row import Record


class Executor(Protocol):
    """Measures units somewhere; `campaigns.pool.LocalPool` does so on this machine.

    What a unit gives depends on the plan alone, and never on who measured it or when; only that it was lost may.
    """

    def execute(
        self, plan: Plan, units: Iterable[Unit], *, frames: Path | None, note: Callable[[str], None]
    ) -> Generator[Record]:
        """Records of the units as they are finished, in any order; every unit gives one.

        Frames are kept in the folder `frames` if it is given; `note` is told in a sentence what a user should know.
        Raises RunError if nothing can be measured. Closing the iterator stops the work. Once
        `campaigns.interruption.interruption` is asked for, it gives what is finished and ends.
        """
