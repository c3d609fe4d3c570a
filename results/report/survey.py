"""Charts over all that a run compares: accuracy by power and by exposure, and how much of it was localized at all."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from itertools import pairwise

import numpy as np
import pandas as pd

from conespot.results.light_exposure import shares_of_limit
from conespot.results.report.chart import Json, numbers, panels, plain, tone
from conespot.results.report.words import rig_words, share
from conespot.results.run import Run
from conespot.results.variants import split

_SHADES = ("single", "triple", "y", "paper", "about-y", "about-z", "overall", "failed")
_DASHES = ("solid", "dash", "dot", "dashdot")
_MOST_LINES, _MOST_BARS, _MOST_REASONS, _MOST_POINTS = 24, 40, 6, 200
_MOST_TICKS, _APART = 12, 1.12  #: numbers on an axis, and by what factor they differ so that none stands over another
_ERROR = "position_error_mm"


def accuracy(run: Run) -> dict[str, tuple[list[Json], Json]]:
    """Median position errors over power, and over the share of the exposure limit; none where neither varies."""
    found: dict[str, tuple[list[Json], Json]] = {}
    if run.rows is None or run.rows.frame["power_w"].nunique() < 2:
        return found
    frame = run.rows.frame
    found["power"] = _lines(run, frame["power_w"], "light power [W]", lambda x: f"{x} W")
    shares = shares_of_limit(run)
    exposed = frame["case"].map(shares).astype(float)
    if exposed.gt(0.0).any():
        named = "share of the exposure limit, spotlights alone"
        found["exposure"] = _lines(run, exposed, named, lambda x: f"{x} of the limit")
        found["exposure"][1]["shapes"] = [_limit()]
        ends = np.log10([min(1.0, exposed[exposed > 0.0].min()), max(1.0, exposed.max())])
        found["exposure"][1]["xaxis"] |= {"range": (ends + [-0.15, 0.15]).tolist()}
    return found


def _lines(run: Run, places: pd.Series, x: str, said: Callable[[str], str]) -> tuple[list[Json], Json]:
    assert run.rows is not None
    layout = panels([[""]], x, ["median position error [mm]"], height=380)
    layout["xaxis"] |= {"type": "log", **_ticks(places)}
    layout["yaxis"] |= {"type": "log"}
    traces: list[Json] = []
    frame = run.rows.frame[[*run.rows.group, "status", _ERROR]].assign(place=places)
    for k, (variant, part) in enumerate(split(frame, run.rows.group)):
        for j, ((surface, trajectory, rig), here) in enumerate(
            part.groupby(["surface", "trajectory", "spotlights"], sort=True)
        ):
            if len(traces) == _MOST_LINES:
                return traces, layout
            boxes = _boxes(here)
            if len(boxes) > 1:
                where = f"{trajectory}, {rig_words(str(rig))}" + ("" if surface == "smooth" else f", {surface}")
                traces.append(_line(boxes, f"{variant.label}: {where}", k, j, said))
    return traces, layout


def _ticks(places: pd.Series) -> Json:
    """Where a logarithmic axis has numbers: at its few places, or at whole decades with the digits between them."""
    there = sorted({float(f"{place:.3g}") for place in places[places > 0.0]})
    apart = all(b > _APART * a for a, b in pairwise(there))
    if apart and len(there) <= _MOST_TICKS:
        return {"tickmode": "array", "tickvals": there, "ticktext": [f"{place:g}" for place in there]}
    return {
        "dtick": 1,
        "exponentformat": "none",
        "separatethousands": True,
        "minor": {"dtick": "D1", "ticks": "outside"},
    }


def _boxes(rows: pd.DataFrame) -> pd.DataFrame:
    """Median, quartiles and counts by place, along the axis."""
    ok = rows[(rows["status"] == "ok") & (rows["place"] > 0.0)]
    if ok.empty:
        return pd.DataFrame()
    found = ok.groupby("place")[_ERROR].quantile(np.array([0.25, 0.5, 0.75])).unstack()
    found = found.assign(n=ok.groupby("place").size(), of=rows.groupby("place").size())
    return found.iloc[:: max(1, -(-len(found) // _MOST_POINTS))]


def _line(boxes: pd.DataFrame, name: str, shade: int, dash: int, said: Callable[[str], str]) -> Json:
    colour = tone(_SHADES[shade % len(_SHADES)])
    told = [[f"{low:.4g}", f"{high:.4g}", f"{n} of {of}"] for low, high, n, of in zip(
        boxes[0.25], boxes[0.75], boxes["n"], boxes["of"], strict=True)]  # fmt: skip
    words = "median %{y} mm<br>quartiles %{customdata[0]} to %{customdata[1]} mm<br>localized %{customdata[2]}"
    return {
        "type": "scatter", "mode": "lines+markers", "name": plain(name), "x": numbers(boxes.index),
        "y": numbers(boxes[0.5]), "customdata": told, "marker": {"size": 6, "color": colour},
        "line": {"color": colour, "width": 1.8, "dash": _DASHES[dash % len(_DASHES)]},
        "hovertemplate": f"<b>{said('%{x}')}</b><br>{words}<extra>{plain(name)}</extra>",
    }  # fmt: skip


def _limit() -> Json:
    line = {"color": tone("failed"), "width": 1.5, "dash": "dash"}
    label = {
        "text": "limit",
        "textangle": 0,
        "textposition": "end",
        "xanchor": "left",
        "font": {"color": tone("failed")},
    }
    return {"type": "line", "x0": 1, "x1": 1, "y0": 0, "y1": 1, "yref": "paper", "line": line, "label": label}


def coverage(run: Run) -> tuple[list[Json], Json, int] | None:
    """Bars of the frames that were localized, and of those that were not by reason, for each variant and rig.

    Of many they are those of which the largest shares were refused; last comes how many are left out.
    """
    if run.rows is None:
        return None
    counted: dict[str, Counter[str]] = {}
    for variant, part in split(run.rows.frame[[*run.rows.group, "status", "reason"]], run.rows.group):
        for rig, here in part.groupby("spotlights", sort=True):
            why = here["reason"].where(here["status"] != "ok", "")
            counted[f"{variant.label}, {rig_words(str(rig))}"] = Counter(
                {" ".join(str(reason).split()): int(n) for reason, n in why.value_counts().items()}
            )
    left_out = max(0, len(counted) - _MOST_BARS)
    if left_out:
        most = sorted(counted, key=lambda label: counted[label][""] / counted[label].total())[:_MOST_BARS]
        refused = [label for label in most if counted[label][""] < counted[label].total()] or most
        left_out += len(most) - len(refused)
        counted = {label: of for label, of in counted.items() if label in refused}
    totals: Counter[str] = sum(counted.values(), Counter())
    reasons = [reason for reason, _ in totals.most_common() if reason][:_MOST_REASONS]
    layout = panels([[""]], "share of the frames", [""], height=40 * len(counted) + 60)
    layout |= {"barmode": "stack"}
    layout["xaxis"] |= {"range": [0, 1], "tickformat": ".0%"}
    layout["yaxis"] |= {"autorange": "reversed", "automargin": True, "ticksuffix": "  "}
    shades = ("failed", "triple", "about-y", "paper", "about-z", "quiet")
    traces = [_bar(counted, "localized", [""], "single")]
    traces += [_bar(counted, reason, [reason], shade) for reason, shade in zip(reasons, shades, strict=False)]
    rest = [reason for reason in totals if reason and reason not in reasons]
    return traces + ([_bar(counted, "other reasons", rest, "line")] if rest else []), layout, left_out


def _bar(counted: Mapping[str, Counter[str]], name: str, reasons: Sequence[str], shade: str) -> Json:
    found = [sum(of[reason] for reason in reasons) for of in counted.values()]
    whole = np.array([max(of.total(), 1) for of in counted.values()])
    told = [f"{n} of {of} ({share(n, of)})" for n, of in zip(found, whole, strict=True)]
    short = name if len(name) <= 60 else f"{name[:58]}…"
    return {
        "type": "bar", "orientation": "h", "y": [plain(label) for label in counted],
        "x": numbers(np.array(found) / whole), "name": plain(short), "customdata": told,
        "marker": {"color": tone(shade)}, "hovertemplate": f"{plain(name)[:300]}<br>%{{customdata}}<extra></extra>",
    }  # fmt: skip
