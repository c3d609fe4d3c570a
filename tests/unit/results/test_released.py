"""results.released: the authors' 100 estimates, and ours on their spiral."""

import numpy as np
import pytest

from conespot.results.boxes import box_table
from conespot.results.run import load_run
from conespot.results.tables import make_tables
from conespot.scene import Eye, Pose
from conespot.scene.trajectory import Spiral

RCM = (6.0, 0.0, 22.0)
THEIRS = Spiral(radius=np.pi, height=2.0, climb=5.0, turns=5.0).positions(100, np.random.default_rng(0))


def test_the_spiral_is_the_one_whose_estimates_they_released():
    angle = 10.0 * np.pi * np.arange(100) / 99.0
    expected = np.column_stack(
        [0.1 * angle * np.cos(angle), 0.1 * angle * np.sin(angle), 2.0 + 5.0 * angle / angle[-1]]
    )
    np.testing.assert_allclose(THEIRS, expected, atol=1e-12)


@pytest.fixture
def released(tmp_path, make_run, make_rows):
    """The table of a run whose estimates lie too near the retina, as those of a cone taken for a wider one do."""

    def table(tips):
        frame = make_rows(poses=100, trajectories=("spiral",), rigs=("single",), powers=(1.0,))
        axis = np.array([Pose.through(tip, RCM).axis for tip in tips])
        distance = Eye(radius=12.5).intersect(tips, axis)
        off = (0.00361 * distance - 0.0023)[:, None] * axis
        for i, name in enumerate("xyz"):
            frame[f"true_{name}_mm"], frame[f"est_{name}_mm"] = tips[:, i], tips[:, i] + off[:, i]
            frame[f"error_{name}_mm"] = off[:, i]
        frame["position_error_mm"] = np.linalg.norm(off, axis=1)
        run = load_run(make_run(tmp_path / "run", frame))
        made = {table.name: table for table in make_tables(run, box_table(run.rows))}
        return made.get("released")

    return table


def test_a_cone_that_is_taken_for_a_wider_one_shows_its_line_along_the_axis(released):
    found = released(THEIRS).frame.set_index("statistic")
    assert found.loc["slope", "ours"] == pytest.approx(-0.00361, abs=1e-9)
    assert found.loc["offset", "ours"] == pytest.approx(0.0023, abs=1e-8)
    assert found.loc["residual", "ours"] == pytest.approx(0.0, abs=1e-9)
    assert found.loc["mean", "published"] == 0.0318
    assert found.loc["largest", "ratio"] == pytest.approx(found.loc["largest", "ours"] / 0.1038)


def test_another_spiral_is_not_compared_with_it(released):
    assert released(Spiral().positions(100, np.random.default_rng(0))) is None
