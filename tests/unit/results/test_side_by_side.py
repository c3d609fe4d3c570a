"""Two runs laid side by side: known differences are found, noise is not, and what does not match is said."""

import pytest

from conespot.results import load_run
from conespot.results.report.beside import lay_beside
from conespot.results.side_by_side import side_by_side
from conespot.scene import InputError

SCRIPT = "<script>alert('1')</script>"


@pytest.fixture
def two(tmp_path, make_rows, make_run, make_campaign):
    """Runs over two powers, the second changed by a function of its rows."""

    def made(change, **campaign):
        rows = make_rows(poses=25, powers=(0.1, 1.0), trajectories=("box",), rigs=("single",))
        first = make_run(tmp_path / "a", rows)
        second = make_run(tmp_path / "b", change(rows.copy()), document=make_campaign(**campaign))
        return load_run(first), load_run(second)

    return made


def test_a_known_shift_is_found_on_the_same_poses(two):
    """Errors of 1 W twice as large, those of 0.1 W as they were, in another light."""

    def worse(rows):
        rows["illumination"] = "ir850"
        rows.loc[rows["power_w"] == 1.0, "position_error_mm"] *= 2.0
        return rows

    found = side_by_side(*two(worse))
    assert found.keys == ("power_w",)  # the light is what they compare
    table = found.table.set_index("power_w")
    assert table.loc[1.0, "ratio"] == pytest.approx(2.0)
    assert table.loc[0.1, "ratio"] == 1.0
    assert table.loc[1.0, "paired"]
    assert table.loc[1.0, "z"] > found.bar
    assert not abs(table.loc[0.1, "z"]) > found.bar
    assert "worse in 1" in found.sentence("a", "b")


def test_other_poses_are_not_paired(two):
    found = side_by_side(*two(lambda rows: rows.assign(true_x_mm=rows["true_x_mm"] + 0.1)))
    assert not found.table["paired"].any()
    assert found.table["z"].tolist() == [0.0, 0.0]


def test_failures_are_counted_and_settings_of_one_alone_told(two):
    def fewer(rows):
        rows = rows[rows["power_w"] == 1.0].reset_index(drop=True)
        rows.loc[:4, ["status", "reason"]] = "failed", "no light"
        return rows

    found = side_by_side(*two(fewer))
    assert found.alone == (1, 0)
    assert found.table[["n_a", "n_b", "failed_a", "failed_b"]].to_numpy().tolist() == [[25, 20, 0, 5]]


def test_runs_without_a_common_setting_are_refused_with_what_differs(two):
    a, b = two(lambda rows: rows.assign(power_w=2.0 * rows["power_w"]))
    with pytest.raises(InputError, match=r"no setting in common: power_w 0\.1 W, 1 W against power_w 0\.2 W"):
        side_by_side(a, b)


def test_the_page_shows_words_of_a_run_as_words_and_the_keys_that_differ(two):
    a, b = two(lambda rows: rows, name=SCRIPT, seed=8)
    page, sentences = lay_beside([a, b])
    text = page.decode()
    assert SCRIPT not in text
    assert "&lt;script&gt;alert" in text
    assert "<td>seed</td>" in text
    assert len(sentences) == 1
    assert "nothing tells" in sentences[0]
