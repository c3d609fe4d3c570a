"""results.paper_values: the transcribed numbers agree with each other as the paper says they do."""

import pytest

from conespot.results.paper_values import BOTH, paper_errors, paper_means, paper_table_1, paper_value


def test_the_whole_of_tables_iv_and_v_is_there():
    sources = [row.source for row in paper_errors()]
    assert {s: sources.count(s) for s in sources} == {"Table IV": 16, "Table V": 8, "abstract": 4, "conclusion": 2}


@pytest.mark.parametrize("metric", ["position_error_mm", "rotation_error_deg"])
@pytest.mark.parametrize("rig", ["single", "triple"])
def test_the_abstract_is_the_mean_of_table_iv(rig, metric):
    mean = sum(paper_value("Table IV", t, rig, "AE", metric) for t in ("box", "helix")) / 2
    assert paper_value("abstract", BOTH, rig, "AE", metric) == pytest.approx(mean, abs=0.0005 + 1e-12)


def test_the_mean_never_exceeds_the_maximum_and_three_spotlights_are_no_worse():
    for row in paper_errors():
        if row.source.startswith("Table"):
            where = (row.source, row.trajectory)
            assert row.value <= paper_value(*where, row.spotlights, "ME", row.metric)
            assert row.value >= paper_value(*where, "triple", row.quantity, row.metric)


def test_the_difference_grows_with_the_cone():
    angles, differences = zip(*paper_table_1().items(), strict=True)
    assert angles == (5.0, 7.0, 9.0, 11.0, 13.0, 15.0)
    assert sorted(differences) == list(differences)


def test_what_the_paper_does_not_give_is_none():
    assert paper_value("Table V", "box", "single", "AE", "position_error_mm") is None
    assert paper_value("conclusion", BOTH, "single", "AE", "rotation_error_deg") is None


def test_means_far_above_ours_are_left_out_of_figures():
    def drawn(most):
        return paper_means("Table IV", "box", ["single", "triple", "2 spotlights"], "position_error_mm", most)

    assert drawn(0.02) == drawn(float("nan")) == {"single": 0.026, "triple": 0.023}
    assert drawn(0.008) == {"triple": 0.023}
    assert drawn(0.001) == {}
    assert paper_means(None, "box", ["single"], "position_error_mm", 1.0) == {}
