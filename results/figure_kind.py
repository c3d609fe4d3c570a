"""What a kind of figure is: which parts of a run it suits, what its files are called, and how it is drawn."""

from __future__ import annotations

import re
from abc import ABC, abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass
from typing import ClassVar

import pandas as pd
from matplotlib.figure import Figure

from conespot.results.assumptions import assumptions, pairs
from conespot.results.paper_values import paper_table
from conespot.results.run import Run
from conespot.results.style import KINDS
from conespot.results.variants import Variant


@dataclass(frozen=True)
class Cut:
    """What one figure can show: the rows and the stored boxes of one variant, surface and trajectory."""

    run: Run
    variant: Variant
    surface: str
    trajectory: str
    rows: pd.DataFrame
    boxes: pd.DataFrame

    @property
    def paper_table(self) -> str | None:
        """The paper's table of the same errors."""
        return paper_table(self.surface, self.trajectory)

    @property
    def assumed(self) -> str:
        """Localizer and assumption set in a sentence."""
        sentence = assumptions(self.run.cases, pairs(self.rows)).sentence()
        return f"Localizer: {self.variant.setting['localizer']}; {sentence}."


class FigureKind(ABC):
    """A kind of figure. `name` begins the names of its files, except where the figure is one of the paper's.

    `what` begins the title; `numbers` are the paper's figures by trajectory, on the smooth retina.
    """

    name: ClassVar[str]
    what: ClassVar[str]
    numbers: ClassVar[Mapping[str, int]] = {}
    of_run: ClassVar[bool] = False  #: drawn once, of all its rows; such a figure stands for those of single variants

    def suits(self, cut: Cut) -> bool:
        """Whether there is anything to draw."""
        return len(cut.rows) > 0

    @abstractmethod
    def caption(self, cut: Cut) -> str:
        """What the figure shows and assumes, so that the file stands alone."""

    @abstractmethod
    def draw(self, cut: Cut, title: str, caption: str) -> Figure:
        """The figure; called inside `style`."""

    def title(self, cut: Cut) -> str:
        """What stands above it, and in the report."""
        number = self._number(cut)
        first = f"Fig. {number}  " if number else ""
        on = "" if cut.surface == "smooth" else f" on {cut.surface}"
        return f"{first}{self.what} {cut.trajectory}{on} ({cut.variant.label})"

    def stem(self, cut: Cut) -> str:
        """The name of its files without what follows the dot."""
        number = self._number(cut)
        if number:
            return f"figure_{number}_{cut.variant.slug}"
        return "_".join((self.name, *(_plain(part) for part in (cut.trajectory, cut.surface)), cut.variant.slug))

    def made(self, file: str) -> bool:
        """Whether a file of that name is one of this kind's, now or in an earlier report."""
        begins = "|".join([re.escape(self.name), *(f"figure_{number}" for number in self.numbers.values())])
        return re.fullmatch(rf"({begins})_.+\.({'|'.join(KINDS)})", file) is not None

    def _number(self, cut: Cut) -> int | None:
        return self.numbers.get(cut.trajectory) if cut.surface == "smooth" else None


def _plain(name: str) -> str:
    return "".join(c if c.isascii() and c.isalnum() else "-" for c in name)[:40]
