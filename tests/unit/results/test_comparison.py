"""Two lights compared: statistics against scipy and hand calculations, and hostile input."""

import numpy as np
import pandas as pd
import pytest
from scipy.stats import wilcoxon

from conespot.campaigns.compare import compare as compare_command
from conespot.results.compare_runs import compare_runs
from conespot.results.comparison import compare_lights, interval
from conespot.results.rows import Rows
from conespot.scene import InputError


@pytest.fixture
def two_lights(make_rows):
    """Rows in white light, and the same poses at 850 nm with errors shifted and scattered."""

    def make(shift_mm=-0.004, scatter=0.003, poses=30, seed=1, **settings):
        white = make_rows(poses=poses, trajectories=("box",), rigs=("single",), powers=(0.25, 1.0), **settings)
        infrared = white.assign(illumination="ir850", case="1" + white["case"].str[1:])
        change = shift_mm + np.random.default_rng(seed).normal(0.0, scatter, len(white))
        infrared["position_error_mm"] = np.maximum(white["position_error_mm"] + change, 1e-6)
        return white.assign(illumination="led-b3"), infrared

    return make


def test_a_shift_is_found_with_scipy_s_p_value(two_lights):
    """Errors 4 um smaller at 850 nm; against the median, scipy's Wilcoxon test and a sentence that says better."""
    white, infrared = two_lights()
    found = compare_lights([Rows(pd.concat([white, infrared], ignore_index=True))], "led-b3", "ir850", "run")[0]
    here = infrared["power_w"] == 1.0
    change = (infrared["position_error_mm"] - white["position_error_mm"])[here].to_numpy()
    line = found.table[found.table["power_w"] == 1.0].iloc[0]
    assert line["median"] == pytest.approx(np.median(change))
    assert line["p"] == pytest.approx(wilcoxon(change).pvalue)
    assert line["low"] < np.median(change) < line["high"]
    assert found.overall.pairs == 30
    assert "ir850 localizes better than led-b3" in found.sentence
    assert "95 % interval" in found.sentence


def test_no_shift_is_said_to_be_none(two_lights):
    """Errors that differ by scatter alone; against the sentence that the data cannot tell."""
    white, infrared = two_lights(shift_mm=0.0)
    found = compare_lights([Rows(white), Rows(infrared)], "led-b3", "ir850", "run")[0]
    assert "the data cannot tell ir850 from led-b3" in found.sentence
    assert found.overall.low < 0.0 < found.overall.high


def test_few_pairs_cannot_tell(two_lights):
    """Five poses with a huge shift; against the sentence that they are too few."""
    white, infrared = two_lights(shift_mm=1.0, poses=5)
    found = compare_lights([Rows(white), Rows(infrared)], "led-b3", "ir850", "run")[0]
    assert not found.overall.tells
    assert "only 5 poses" in found.sentence


def test_failures_on_either_side_are_counted_and_tested(two_lights):
    """White light fails on 12 poses; against counts of both sides, pairs left and a sign test in the sentence."""
    white, infrared = two_lights()
    lost = white["pose"] < 12
    white.loc[lost, "status"] = "failed"
    white.loc[lost, "position_error_mm"] = np.nan
    found = compare_lights([Rows(white), Rows(infrared)], "led-b3", "ir850", "run")[0]
    assert (found.overall.failed_a, found.overall.failed_b, found.overall.poses) == (24, 0, 60)
    assert found.overall.pairs == 18
    assert found.overall.p_failures == pytest.approx(2.0 * 0.5**12)
    assert "fails less often" in found.sentence


def test_all_failed_on_one_side_still_gives_an_answer(two_lights):
    """White light fails everywhere; against no pairs and no exception."""
    white, infrared = two_lights()
    white = white.assign(status="failed", position_error_mm=np.nan)
    found = compare_lights([Rows(white), Rows(infrared)], "led-b3", "ir850", "run")[0]
    assert found.overall.pairs == 0
    assert "cannot tell" in found.sentence


def test_the_bootstrap_interval_covers_the_median():
    """95 % intervals of 200 normal samples of 40; against the true median: inside 90 to 99 % of the time."""
    rng = np.random.default_rng(5)
    inside = 0
    for _ in range(200):
        low, high = interval(rng.normal(1.0, 1.0, 40))
        inside += low <= 1.0 <= high
    assert 180 <= inside <= 198


def test_rows_that_do_not_pair_are_refused(two_lights):
    """Other poses, an unknown light, two cameras at once; each against one sentence."""
    white, infrared = two_lights()
    with pytest.raises(InputError, match=r"differ by 0\.5 mm"):
        compare_lights(
            [Rows(white), Rows(infrared.assign(true_x_mm=infrared["true_x_mm"] + 0.5))], "led-b3", "ir850", "run"
        )
    with pytest.raises(InputError, match="no frames in the light 'ir940'"):
        compare_lights([Rows(white)], "led-b3", "ir940", "run")
    twice = pd.concat([infrared, infrared.assign(sensor="linear", case="other")], ignore_index=True)
    with pytest.raises(InputError, match="several frames of one pose"):
        compare_lights([Rows(white), Rows(twice)], "led-b3", "ir850", "run")


def test_a_run_gets_text_table_and_figures_with_its_exposures(two_lights, make_run, tmp_path):
    """A run folder of two lights; against its files, and the retinal exposure of both with its label."""
    folder = make_run(tmp_path / "run", pd.concat(two_lights(), ignore_index=True))
    text = compare_runs([folder])
    assert (folder / "comparison.txt").read_text() == text
    assert "ir850: peak retinal irradiance" in text
    assert "ir850 assumes: radius: 12.5 mm; edge: Cycles blend 1 (fully soft), half angle 9 deg; power conv" in text
    assert "2007 edition; dose: ICNIRP 2013, aphakic; research estimate, not a safety assessment" in text
    assert {"median_mm", "p", "pairs", "failed_a"} <= set(pd.read_csv(folder / "tables" / "comparison.csv").columns)
    assert len(list((folder / "figures").glob("comparison_ir850_led-b3_*"))) == 3


def test_one_light_has_nothing_to_compare(make_rows, make_run, tmp_path):
    """A run in one light, and bad --lights; against a sentence that says what to do."""
    folder = make_run(tmp_path / "run", make_rows(poses=4))
    with pytest.raises(InputError, match="all frames are in one light, white"):
        compare_runs([folder])
    with pytest.raises(InputError, match="--lights led-b3: write the reference and another light"):
        compare_command([folder], "led-b3")
