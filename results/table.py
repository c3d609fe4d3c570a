"""A table, as data and as people read it: text for the terminal, markdown for documents."""

from __future__ import annotations

import math
import re
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import pandas as pd

from conespot.results.assumptions import Assumptions, common

_MOST_BLOCKS = 24
_MOST_LINES = 400
_WORD = re.compile(r"[^\W\d_]{4}")


@dataclass(frozen=True)
class Block:
    """A part of a table for the eye; `assumes` is what its numbers assume, where the notes do not say it."""

    heading: str
    header: tuple[str, ...]
    lines: tuple[tuple[str, ...], ...]
    notes: tuple[str, ...]
    assumes: Assumptions | None = None

    @cached_property  # a template asks for every line
    def flush_right(self) -> tuple[bool, ...]:
        """Which columns hold numbers."""
        columns = list(zip(*self.lines, strict=True)) or [()] * len(self.header)
        return tuple(all(not cell or _is_number(cell) for cell in column) for column in columns)


@dataclass(frozen=True)
class Table:
    """`frame` is the tidy data of tables/`name`.csv, `blocks` the same for the eye."""

    name: str
    title: str
    frame: pd.DataFrame
    blocks: tuple[Block, ...]
    notes: tuple[str, ...] = ()

    @property
    def shown(self) -> tuple[Block, ...]:
        """The blocks that people are shown: a sweep over thousands of values stays readable."""
        return tuple(replace(block, lines=block.lines[:_MOST_LINES]) for block in self.blocks[:_MOST_BLOCKS])

    @property
    def left_out(self) -> str:
        """What `shown` leaves out, in a sentence; empty if nothing."""
        blocks = len(self.blocks) - len(self.shown)
        lines = sum(len(block.lines) for block in self.blocks) - sum(len(block.lines) for block in self.shown)
        what = f"{blocks} more blocks ({lines} lines)" if blocks else f"{lines} lines more"
        return f"{what} stand in tables/{self.name}.csv." if lines else ""

    @property
    def shared(self) -> dict[str, str]:
        """What all blocks assume alike, by column: it is told once."""
        return common(block.assumes for block in self.blocks if block.assumes is not None)

    def notes_of(self, block: Block) -> tuple[str, ...]:
        """The notes of a block, with what it assumes beyond `shared`."""
        own = block.assumes.sentence(beside=self.shared) if block.assumes is not None else ""
        return (*block.notes, f"Assumes: {own}.") if own else block.notes

    @property
    def last_notes(self) -> tuple[str, ...]:
        """The notes of the whole, with what all blocks assume and what `shown` leaves out."""
        shared = Assumptions(**self.shared).sentence(beside=Assumptions().columns().keys() - self.shared.keys())
        several = "All of them assume" if len(self.blocks) > 1 else "Assumes"
        assumed = f"{several}: {shared}." if shared else ""
        return tuple(note for note in (*self.notes, assumed, self.left_out) if note)

    def text(self) -> str:
        """The table for the terminal, numbers flush right."""
        parts = [f"{self.title}\n{'=' * len(self.title)}"]
        for block in self.shown:
            rows = (block.header, *block.lines)
            widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
            lines = [_line(row, widths, block.flush_right) for row in rows]
            lines.insert(1, "  ".join("-" * width for width in widths))
            parts.append("\n".join([block.heading, *("  " + line for line in lines), *self.notes_of(block)]))
        return "\n\n".join([*parts, *self.last_notes]) + "\n"

    def markdown(self) -> str:
        """The table as GitHub-flavoured markdown."""
        parts = [f"## {_escaped(self.title)}"]
        for block in self.shown:
            rows = [[_escaped(cell) for cell in row] for row in (block.header, *block.lines)]
            rows.insert(1, ["--:" if right else "---" for right in block.flush_right])
            parts.append(f"### {_escaped(block.heading)}")
            parts.append("\n".join(f"| {' | '.join(row)} |" for row in rows))
            parts += [_escaped(note) for note in self.notes_of(block)]
        return "\n\n".join([*parts, *map(_escaped, self.last_notes)]) + "\n"


def _is_number(cell: str) -> bool:
    """Whether a cell is a number, perhaps with a unit; "12 mm seen through ..." is words."""
    return cell[0] in "–-+.0123456789" and not _WORD.search(cell)


def number(value: float) -> str:
    """A number as people read it: three digits, a dash for none."""
    if not math.isfinite(value):
        return "–"
    return f"{float(f'{value:.3g}'):.0f}" if 1e3 <= abs(value) < 1e6 else f"{value:.3g}"


def _line(row: Sequence[str], widths: Sequence[int], flush: Sequence[bool]) -> str:
    cells = (c.rjust(w) if right else c.ljust(w) for c, w, right in zip(row, widths, flush, strict=True))
    return "  ".join(cells).rstrip()


_MARKUP = str.maketrans({**{sign: f"\\{sign}" for sign in "\\`*_[]#"}, **{sign: f"&#{ord(sign)};" for sign in "&<>|"}})


def _escaped(text: str) -> str:
    """A run may come from a stranger: nothing in it becomes markup."""
    return text.translate(_MARKUP)
