"""errors.csv is what pandas would write, to the byte."""

import numpy as np
import pandas as pd

from conespot.campaigns.row_text import csv_text


def test_rows_are_written_as_pandas_writes_them_whatever_they_hold():
    rng = np.random.default_rng(1)
    n = 45_000
    odd = [
        0.0,
        -0.0,
        1.0,
        -12.0,
        np.nan,
        np.inf,
        -np.inf,
        1e-4,
        9.999e-5,
        1e9,
        1e16,
        1e22,
        5e-324,
        0.1 + 0.2,
        1e15 + 0.5,
    ]
    words = ["", "a", "a,b", 'say "x"', "two\nlines", "\r", " blank ", "ä", "1", "NA", "'"]
    rows = pd.DataFrame(
        {
            "case": rng.choice(words, n),
            "pose": np.arange(n) - 7,
            "error, mm": rng.normal(size=n) * 10.0 ** rng.integers(-9, 18, n),
            "odd": np.resize(odd, n),
            "none": np.full(n, np.nan),
            "reason": np.resize(words, n).astype(object),
        }
    )
    with np.printoptions(legacy=False):  # colour-science sets numpy's old style, which rounds what pandas writes
        assert csv_text(rows) == rows.to_csv(index=False, lineterminator="\n").encode()
    assert csv_text(rows[:0]) == rows[:0].to_csv(index=False, lineterminator="\n").encode()
