"""Box statistics: Tukey's boxes of every group and metric, kept as data so that figures need nothing else.

Quartiles interpolate linearly between values. The whiskers end at the farthest values within 1.5 interquartile
ranges of the box (Tukey); values beyond them are the outliers. The paper's captions call the whiskers minimum and
maximum and draw outliers as well, which cannot both hold, so min and max are stored too.
"""

from __future__ import annotations

import json
import math
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import ArrayLike
from pandas.api.types import is_numeric_dtype

from conespot.results.columns import METRICS
from conespot.results.rows import Rows

WHISKER_IQR = 1.5
STATISTICS = (
    "n",
    "failed",
    "mean",
    "median",
    "q1",
    "q3",
    "whisker_low",
    "whisker_high",
    "min",
    "max",
    "outliers",
)


def box_statistics(values: ArrayLike, failed: int = 0) -> dict[str, Any]:
    """Tukey's box of the finite `values` `[n]` of the frames that were localized, beside the number that failed.

    `outliers` is the sorted list of values beyond the whiskers. With no value every statistic is NaN.
    """
    x = np.sort(np.asarray(values, float))
    if x.size == 0:
        return {**dict.fromkeys(STATISTICS, math.nan), "n": 0, "failed": failed, "outliers": []}
    q1, median, q3 = np.quantile(x, (0.25, 0.5, 0.75))
    reach = WHISKER_IQR * (q3 - q1)
    inside = x[(x >= q1 - reach) & (x <= q3 + reach)]
    # an interpolated quartile may have no value between itself and its fence: the whisker then has no length
    low, high = min(inside[0], q1), max(inside[-1], q3)
    return {
        "n": int(x.size),
        "failed": failed,
        "mean": float(np.clip(x.mean(), x[0], x[-1])),  # rounding may put the mean of equal values beside them
        "median": float(median),
        "q1": float(q1),
        "q3": float(q3),
        "whisker_low": float(low),
        "whisker_high": float(high),
        "min": float(x[0]),
        "max": float(x[-1]),
        "outliers": [float(v) for v in x[(x < low) | (x > high)]],
    }


def box_table(rows: Rows) -> pd.DataFrame:
    """A box of every metric of every group: the group's columns, `metric`, then `STATISTICS`."""
    found: list[dict[str, Any]] = []
    number = rows.frame.groupby(list(rows.group), sort=True).ngroup().to_numpy()
    order = np.argsort(number, kind="stable")
    parts = np.split(order, np.flatnonzero(np.diff(number[order])) + 1)
    firsts = rows.frame[list(rows.group)].iloc[[part[0] for part in parts]]
    ok, errors = (rows.frame["status"] == "ok").to_numpy(), rows.frame[list(METRICS)].to_numpy(float)
    for key, part in zip(firsts.itertuples(index=False, name=None), parts, strict=True):
        setting = dict(zip(rows.group, key, strict=True))
        located = part[ok[part]]
        failed = len(part) - len(located)
        for i, name in enumerate(METRICS):
            found.append({**setting, "metric": name, **box_statistics(errors[located, i], failed)})
    return pd.DataFrame(found, columns=[*rows.group, "metric", *STATISTICS])


def encode_boxes(boxes: pd.DataFrame) -> bytes:
    """The boxes as CSV; outliers as a JSON list, statistics to nine digits, settings exactly."""
    written = boxes.assign(outliers=[json.dumps([float(f"{v:.9g}") for v in row]) for row in boxes["outliers"]])
    for name in boxes.columns.difference([*STATISTICS, "metric"]):
        if is_numeric_dtype(boxes[name]):
            written[name] = [_exactly(value) for value in boxes[name].tolist()]
    return written.to_csv(index=False, float_format="%.9g", lineterminator="\n").encode()


def read_boxes(path: Path, rows: Rows) -> pd.DataFrame:
    """The boxes of `rows` that `encode_boxes` wrote to a file."""
    missing = {name: [""] for name in STATISTICS if name != "outliers"}
    boxes = pd.read_csv(path, dtype=dict.fromkeys(rows.group, str), keep_default_na=False, na_values=missing)
    for name in rows.group:  # not by pandas, which may not read back the number that was written
        if is_numeric_dtype(rows.frame[name]):
            boxes[name] = pd.Series([float(value) for value in boxes[name]], dtype=rows.frame[name].dtype)
    return boxes.assign(outliers=[json.loads(row) for row in boxes["outliers"]])


def _exactly(value: float) -> str:
    """Powers and swept numbers say which box is which: they read back as they are."""
    short = f"{value:.9g}"
    return short if float(short) == value else repr(value)
