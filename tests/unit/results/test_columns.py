"""results.columns: every column is declared once, and says what its name says."""

import subprocess
import sys

from conespot.results.columns import COLUMNS, METRICS, SETTING, column, names
from conespot.results.variants import AXES


def test_no_column_is_declared_twice():
    assert len({c.name for c in COLUMNS}) == len(COLUMNS)


def test_a_name_ends_in_its_unit():
    """`power_w` in W, `resolution_px` in px; against the last part of every name."""
    units = {"mm": "mm", "deg": "deg", "w": "W", "px": "px"}
    for c in COLUMNS:
        assert c.unit == units.get(c.name.rpartition("_")[2], ""), c.name


def test_every_column_says_what_it_means_and_its_bounds_are_in_order():
    for c in COLUMNS:
        assert c.meaning
        assert c.least < c.most


def test_groups_keep_the_order_of_the_rows():
    assert SETTING == (
        "trajectory", "spotlights", "power_w", "illumination", "surface", "sensor", "resolution_px", "localizer"
    )  # fmt: skip
    assert set(names("identity", "label", "localizer", "pose", "outcome")) == {*SETTING, "case", "frame", "pose",
                                                                              "status", "reason"}  # fmt: skip
    assert set(AXES) < set(SETTING)
    assert all(column(name).unit in ("mm", "deg") for name in METRICS)


def test_who_only_reads_them_loads_no_pandas_and_no_matplotlib():
    code = "import sys, conespot.results.columns; print({'pandas', 'matplotlib'} & set(sys.modules))"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "set()"
