"""A run against what is expected of it: what was found, how far off, and the verdict."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from typing import Any

import pandas as pd
from pandas.api.types import is_numeric_dtype

from conespot.results.assumptions import Assumptions, assumptions, pairs, theory_assumptions, together
from conespot.results.expectation import ANY, Expectation, Expectations, Label
from conespot.results.metrics import METRICS, AnyTable, Metric
from conespot.results.run import Run
from conespot.results.table import Block, Table, number
from conespot.results.variants import AXES, named
from conespot.results.white import white_table
from conespot.scene.document import Document

_MOST_NAMED = 12


class _UnclearError(Exception):
    """Which lines are meant is not clear, or they are not there; the message says which there are."""


@dataclass(frozen=True)
class Verdict:
    """What a run says to an expectation: the number `found` and what it `assumes`, or why it is `unclear`."""

    expectation: Expectation
    found: float = math.nan
    assumes: Assumptions = field(default_factory=Assumptions)
    unclear: str = ""

    @property
    def holds(self) -> bool:
        """True if the number is near enough."""
        return not self.unclear and self.expectation.met_by(self.found)

    @property
    def ratio(self) -> float:
        """Found over expected; NaN where either is none."""
        target = self.expectation.target
        return self.found / target if target else math.nan

    @property
    def word(self) -> str:
        """The verdict in a word or two."""
        return "not judged" if self.unclear else "holds" if self.holds else "misses"

    @property
    def title(self) -> str:
        """What was looked at, such as "AE mm: box, single, 1 W"."""
        listed = _listed(self.expectation)
        where = ", ".join(named(name, value) for name, values in listed for value in values if value != ANY)
        return f"{self.expectation.metric}: {where}" if where else self.expectation.metric

    @property
    def sentence(self) -> str:
        """Expected and found, or why it cannot be judged."""
        if self.unclear:
            return self.unclear
        ratio = f", {number(self.ratio)} times that" if math.isfinite(self.ratio) else ""
        return f"expected {self.expectation.words}, found {number(self.found)}{ratio}"


def expected(document: Document) -> Expectations:
    """What a campaign's file expects. Raises InputError, with the line, for what is no expectation."""
    if "expect" not in document.data:
        return ()
    return document.validate(Expectations, at=("expect",))


def check(run: Run, expectations: Sequence[Expectation]) -> list[Verdict]:
    """The run's verdict on each expectation."""
    tables = {table: _table(run, table) for table in {METRICS[e.metric].table for e in expectations}}
    verdicts = []
    for expectation in expectations:
        metric = METRICS[expectation.metric]
        try:
            frame, labels = tables[metric.table]
            if metric.table == "errors" and frame is not None:
                frame = _own(run, frame, expectation)
            lines = _selected(frame, labels, expectation)
            if metric.table == "errors":
                _refuse_unfinished(run, lines)
            verdicts.append(Verdict(expectation, _value(metric, lines), _assumed(run, metric.table, lines)))
        except _UnclearError as error:
            verdicts.append(Verdict(expectation, unclear=str(error)))
    return verdicts


def verdict_table(verdicts: Sequence[Verdict]) -> Table:
    """Expected, found, ratio and verdict, a line each; those that cannot be judged are counted in a note."""
    judged = [v for v in verdicts if not v.unclear]
    records: list[dict[str, Any]] = []
    lines: list[tuple[str, ...]] = []
    for v in judged:
        e = v.expectation
        numbers = {"value": e.value, "expected": e.words, "found": v.found, "ratio": v.ratio, "verdict": v.word}
        where = v.title.partition(": ")[2]
        records.append({"metric": e.metric, "where": where, **numbers, "source": e.source, **v.assumes.columns()})
        last = v.word if v.holds else v.word.upper()
        lines.append((e.source, e.metric, where, e.words, number(v.found), number(v.ratio), last))
    header = ("source", "metric", "where", "expected", "found", "ratio", "verdict")
    missed = sum(not v.holds for v in judged)
    heading = f"{len(judged) - missed} of {len(judged)} hold" if judged else "nothing to judge"
    left = len(verdicts) - len(judged)
    more = f"{left} more are about what is not, or not unambiguously, in this run: `campaign check` says why."
    # theory assumes next to nothing, and Table I says so itself
    of_frames = [v.assumes for v in judged if v.assumes != theory_assumptions()] or [v.assumes for v in judged]
    assumed = together(of_frames) if judged else None
    block = Block(heading, header, tuple(lines), (more,) if left else (), assumed)
    return Table("expectations", "Expectations of the campaign", pd.DataFrame(records), (block,))


def expectation_table(run: Run) -> Table | None:
    """The verdicts on what the run's own campaign expects; None if it expects nothing that the run holds."""
    verdicts = check(run, expected(run.document))
    return verdict_table(verdicts) if any(not v.unclear for v in verdicts) else None


def _value(metric: Metric, lines: pd.DataFrame) -> float:
    match metric.statistic:
        case "mean" | "max":
            located = lines.loc[lines["status"] == "ok", metric.column]
            return float(located.mean() if metric.statistic == "mean" else located.max())
        case "share":
            return float((lines[metric.column] == "failed").mean())
        case "value":
            return float(lines[metric.column].iloc[0])


def _assumed(run: Run, table: AnyTable, lines: pd.DataFrame) -> Assumptions:
    match table:
        case "errors":
            return assumptions(run.cases, pairs(lines))
        case "table_1":
            return theory_assumptions()
        case "white":
            names = Assumptions().columns()
            return together(Assumptions(*line) for line in lines[list(names)].itertuples(index=False))


def _table(run: Run, table: AnyTable) -> tuple[pd.DataFrame | None, Sequence[str]]:
    """The lines of a table, None if the run has none, and the columns that tell its lines apart."""
    match table:
        case "errors":
            return (run.rows.frame, run.rows.group) if run.rows else (None, ())
        case "table_1":
            return run.theory, ("half_angle_deg",)
        case "white":
            made = white_table(run)
            return (made.frame if made else None), [n for n in (run.rows.group if run.rows else ()) if n not in AXES]


def _own(run: Run, rows: pd.DataFrame, expectation: Expectation) -> pd.DataFrame:
    """The rows of the campaign's own localizers, unless the expectation names which it is about.

    What others scored beside them (`campaign score`) is none of what the campaign's author had in mind.
    """
    own = {name for case in run.cases.values() for name in case.localizers}
    named = expectation.where.get("localizer", ANY) != ANY
    return rows if named or not own else rows[rows["localizer"].isin(own)]


def _refuse_unfinished(run: Run, lines: pd.DataFrame) -> None:
    planned = sum(run.cases[case].poses if case in run.cases else 0 for case, _ in pairs(lines))
    if len(lines) < planned:
        raise _UnclearError(f"{len(lines)} of {planned} poses are finished; `campaign run` continues the run")


def _selected(frame: pd.DataFrame | None, labels: Sequence[str], expectation: Expectation) -> pd.DataFrame:
    if frame is None or frame.empty:
        raise _UnclearError(f"the run holds nothing that '{expectation.metric}' is about")
    for name, wanted in _listed(expectation):
        if name not in labels:
            raise _UnclearError(f"where: there is no '{name}'; there are {_said(labels)}")
        if wanted == (ANY,):
            continue
        column = frame[name]
        masks = [_has(column, label) for label in wanted]
        if not all(mask.any() for mask in masks):
            raise _UnclearError(f"where: no line with {_said(wanted)} as {name}; there {_are(column)}")
        frame = frame[pd.concat(masks, axis=1).any(axis=1)]
    for name in labels:
        if name not in expectation.where and frame[name].nunique() > 1:
            raise _UnclearError(f"where: does not say which {name}; there {_are(frame[name])}")
    return frame


def _listed(expectation: Expectation) -> list[tuple[str, tuple[Label, ...]]]:
    where = expectation.where.items()
    return [(name, labels if isinstance(labels, tuple) else (labels,)) for name, labels in where]


def _has(column: pd.Series, label: Label) -> pd.Series:
    if is_numeric_dtype(column) and isinstance(label, float):
        # a file writes twelve digits of a number at most
        return (column - label).abs() <= 1e-9 * abs(label)
    return column.astype(str) == (label if isinstance(label, str) else f"{label:g}")


def _are(column: pd.Series) -> str:
    values = column.unique()
    return f"{'are' if len(values) > 1 else 'is'} {_said(values)}"


def _said(values: Iterable[object]) -> str:
    words = [f"{value:g}" if isinstance(value, float) else str(value) for value in values]
    return ", ".join(words[:_MOST_NAMED]) + (" ..." if len(words) > _MOST_NAMED else "")
