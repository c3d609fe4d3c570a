"""results.near_wall: intervals that hold, false "safe", and its binomial bound."""

import numpy as np
import pandas as pd
import pytest

from conespot.results.near_wall import near_wall


def rows(true, off, sigma, status="ok", source=0.0):
    """Rows of tips at those true distances, found `off` beside [mm]."""
    true, off, sigma = np.broadcast_arrays(np.asarray(true, float), off, sigma)
    ways = {}
    for way in ("nearest", "along"):
        ways |= {f"true_{way}_mm": true, f"est_{way}_mm": true + off}
        ways |= {f"est_error_{way}_mm": off, f"est_sigma_{way}_mm": sigma}
    return pd.DataFrame({**ways, "est_source_mm": source, "status": status})


def test_an_interval_holds_up_to_1_96_sigmas():
    found = near_wall(rows(0.5, [0.0195, -0.0195, 0.0197, 0.0], 0.01))
    assert found["held_nearest"] == 0.75
    assert found["held_along"] == 0.75


def test_what_is_refused_is_counted_neither_as_safe_nor_as_false():
    refused = rows([0.05, 0.5], np.nan, np.nan, status="failed")
    found = near_wall(pd.concat([rows([0.5, 0.05], 0.0, 0.01), refused], ignore_index=True))
    assert (found["n"], found["refused"], found["safe"]) == (4, 2, 1)
    assert (found["false_safe"], found["below_alarm"]) == (0, 2)


def test_a_false_safe_is_a_tip_below_the_alarm_whose_bound_lies_above_it():
    found = near_wall(rows([0.09, 0.09, 0.11], [0.05, 0.03, 0.05], 0.01))  # 3.09 sigmas: 0.109, 0.089, 0.129 mm
    assert (found["safe"], found["false_safe"]) == (2, 1)


def test_what_a_wide_source_may_pass_for_is_taken_off_first():
    assert near_wall(rows([0.12], 0.3, 0.01, source=0.3))["safe"] == 0
    assert near_wall(rows([0.12], 0.3, 0.01, source=0.2))["safe"] == 1


@pytest.mark.parametrize(("count", "bound"), [(20, 0.1684), (300, 0.01222)])
def test_none_of_n_is_bounded_as_clopper_and_pearson_have_it(count, bound):
    found = near_wall(rows(np.full(count, 0.05), 0.0, 0.01))
    assert found["false_safe"] == 0
    assert found["false_safe_at_most"] == pytest.approx(bound, rel=1e-3)
    assert found["false_safe_at_most"] == pytest.approx(1.0 - 0.025 ** (1.0 / count))
