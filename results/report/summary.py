"""Three sentences that say what a run found, written from its numbers."""

from __future__ import annotations

import math
import re
from collections.abc import Sequence

import pandas as pd

from conespot.results.assumptions import pairs, power_in_words
from conespot.results.check import Verdict, check, expected
from conespot.results.pose_figure import at_reference_power
from conespot.results.reality_gap import costs, is_gap, names
from conespot.results.report.words import share, um
from conespot.results.run import Run
from conespot.results.variants import split

_ERROR = "position_error_mm"
_MOST_NAMED = 3
#: stays on the line of its number
_UNIT = re.compile(r"(?<=\d) (W|mW|um|mm|deg|%)(?!\w)")


def summary(run: Run) -> list[str]:
    """How much was localized, how well, and how that stands beside what is published or expected."""
    if run.rows is None:
        said = ["The run holds theory alone: no frame was rendered."]
    else:
        said = [_localized(run.rows.frame), _accurate(run)]
    return [_UNIT.sub("\u00a0\\1", sentence) for sentence in (*said, *_beside(run))]


def _localized(frame: pd.DataFrame) -> str:
    failed = frame.loc[frame["status"] == "failed", "reason"]
    methods = [str(name) for name in frame["localizer"].unique()]
    who = " and ".join(methods) if len(methods) <= _MOST_NAMED else f"{len(methods)} localizers"
    frames = frame.groupby("case", sort=False)["pose"].nunique().sum() if "frame" not in frame else len(
        frame.drop_duplicates(["frame", "pose"]))  # fmt: skip
    done = f"Shown {frames:,} frames, {who} localized {share(len(frame) - len(failed), len(frame))} of them"
    if failed.empty:
        return f"{done} and refused none."
    reason, count = failed.value_counts().index[0], int(failed.value_counts().iloc[0])
    most = f"most often because of “{' '.join(str(reason).split())[:160]}” ({count:,} times)"
    return f"{done} and refused {len(failed):,}, {most}."


def _accurate(run: Run) -> str:
    assert run.rows is not None
    medians: list[tuple[float, float, float, str, pd.DataFrame]] = []
    told = run.rows.frame[[*run.rows.group, "case", "status", _ERROR]]
    for variant, part in split(told, run.rows.group):
        rows = at_reference_power(part)
        good = rows.loc[rows["status"] == "ok", _ERROR]
        if len(good):
            medians.append((float(good.median()), float(good.mean()), float(good.max()), variant.label, rows))
    if not medians:
        return "No frame at the reference power was localized, so there is no error to speak of."
    medians.sort(key=lambda found: found[0])
    median, mean, most, label, rows = medians[0]
    power = power_in_words(run.cases, pairs(rows), float(rows["power_w"].iloc[0]))
    best = (
        f"At {power}, {label} places the tip {um(median)} from the truth at the median "
        f"({um(mean)} on average, at most {um(most)})"
    )
    if len(medians) == 1:
        return f"{best}."
    worst = medians[-1]
    many = "the other" if len(medians) == 2 else f"the last of {len(medians)}"
    return f"{best}; {many}, {worst[3]}, {um(worst[0])}."


def _beside(run: Run) -> list[str]:
    verdicts = [v for v in check(run, expected(run.document)) if not v.unclear]
    if verdicts:
        return [_judged(verdicts)]
    if run.rows is not None and is_gap(run):
        found = _costliest(run.rows.frame)
        return [found] if found else []
    return ["Its campaign expects nothing of it, so no number here is judged."]


def _judged(verdicts: Sequence[Verdict]) -> str:
    held = sum(v.holds for v in verdicts)
    first = f"Of {len(verdicts)} published values and bounds that its campaign expects, {held} hold"
    published = [v for v in verdicts if v.expectation.source and v.expectation.within is not None]
    far = [v for v in published if math.isfinite(v.ratio) and v.ratio > 0.0]
    if not far:
        return f"{first}."
    worst = max(far, key=lambda v: abs(math.log(v.ratio)))
    where = f"{worst.expectation.source}, {worst.title}"
    return f"{first}; farthest from the paper is {where}: {worst.ratio:.3g} times the published."


def _costliest(frame: pd.DataFrame) -> str:
    """The effect that multiplies a localizer's median error most."""
    found = costs(frame)
    effects = names(frame, "effect")
    ratios = []
    for (localizer, effect, light), cost in found.items():
        ideal = found.get((localizer, effects[0], light))
        if ideal and ideal.median > 0.0 and math.isfinite(cost.median):
            ratios.append((cost.median / ideal.median, effect, localizer, light))
    if not ratios:
        return ""
    ratio, effect, localizer, light = max(ratios)
    return f"The costliest effect is {effect}: it multiplies the median error of {localizer} in {light} by {ratio:.3g}."
