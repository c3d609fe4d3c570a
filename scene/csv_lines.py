"""CSV files as spreadsheets of any country write them: bounded, and either read as they were meant or refused.

Cells stand between commas, or between semicolons or tabs where the decimal sign may be a comma; quoted or not; in UTF-8
or, with its mark, UTF-16; lines end in any way. Blank lines, and those that begin with `#`, are no data.
"""

from __future__ import annotations

import csv
import io
import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path

from conespot.scene.text_file import read_text

_MAX_BYTES = 20_000_000
#: what Excel puts on top of a file to say what stands between its cells
_SEPARATOR = re.compile(r"sep=(.)\s*", re.ASCII | re.IGNORECASE)
_NUMBER = re.compile(r"[+-]?(?:(?:\d+\.?\d*|\.\d+)(?:e[+-]?\d+)?|nan|inf)", re.ASCII | re.IGNORECASE)
#: lines that must all hold what stands between cells
_LOOKED_AT = 5


@dataclass(frozen=True)
class CsvLine:
    """Cells of a line, without the blanks around them and without empty ones at its end."""

    number: int
    cells: tuple[str, ...]
    commas: bool = False  #: whether a comma in a number is its decimal sign
    signs: set[str] = field(default_factory=set)  #: decimal signs of the file so far

    def value(self, column: int) -> float:
        """The number in a cell, finite or not. Raises ValueError for anything else."""
        text = self.cells[column] if column < len(self.cells) else ""
        written = text.replace(",", ".") if self.commas else text
        if not _NUMBER.fullmatch(written):
            raise ValueError(f"{text[:40]!r} is no number" if text else "a cell is empty")
        self.signs.update(sign for sign in ".," if sign in text)
        if len(self.signs) > 1:
            raise ValueError("decimal points and decimal commas are mixed")
        return float(written)


def csv_lines(path: Path, what: str) -> Iterator[CsvLine]:
    """The lines of data of a `what`, a header among them. Raises ValueError, with the line, for what is no CSV."""
    try:
        text = read_text(path, _MAX_BYTES, what)
    except ValueError as error:
        raise ValueError(str(error).replace("cannot be read", "cannot be read as CSV", 1)) from None
    if "\0" in text:
        raise ValueError(f"{path}: cannot be read as CSV: holds NUL characters; save the {what} as 'CSV UTF-8'")
    lines = ["" if line.startswith("#") else line for line in io.StringIO(text, newline=None)]
    between = _between(lines)
    reader = csv.reader(lines, delimiter=between, skipinitialspace=True, strict=True)
    signs: set[str] = set()
    try:
        for row in reader:
            cells = [cell.strip() for cell in row]
            while cells and not cells[-1]:
                cells.pop()
            if cells:
                yield CsvLine(reader.line_num, tuple(cells), between != ",", signs)
    except csv.Error as error:
        raise ValueError(f"{path}:{reader.line_num}: cannot be read as CSV ({error})") from None


def _between(lines: list[str]) -> str:
    """What stands between the cells; a line that says so and nothing else is taken out of the `lines`."""
    first = [i for i, line in enumerate(lines) if line.strip()][:_LOOKED_AT]
    said = _SEPARATOR.fullmatch(lines[first[0]]) if first else None
    if said:
        lines[first[0]] = ""
        return said[1]
    return next((sign for sign in "\t;" if first and all(sign in lines[i] for i in first)), ",")


def columns(path: Path, header: CsvLine, names: Sequence[str]) -> list[int]:
    """Where the named columns stand in a header. Raises ValueError if one is missing or any column stands twice."""
    missing = [name for name in names if name not in header.cells]
    if missing:
        raise ValueError(
            f"{path}:{header.number}: no column {', '.join(missing)}; a header {','.join(names)} is needed"
        )
    twice = [cell for i, cell in enumerate(header.cells) if cell and cell in header.cells[:i]]
    if twice:
        raise ValueError(f"{path}:{header.number}: the column {twice[0][:40]} stands twice; every name needs its own")
    return [header.cells.index(name) for name in names]


def within(path: Path, header: CsvLine, line: CsvLine) -> CsvLine:
    """The line. Raises ValueError if it has more cells than the header: then it is not known which are meant."""
    if len(line.cells) > len(header.cells):
        raise ValueError(
            f"{path}:{line.number}: {len(line.cells)} cells below a header of {len(header.cells)}; "
            "with commas as decimal signs, write semicolons between the cells"
        )
    return line
