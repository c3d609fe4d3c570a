"""results.rows and results.run: a run folder is hostile until validated."""

import numpy as np
import pandas as pd
import pytest

from conespot.results import rows as rows_module
from conespot.results.columns import COLUMNS, SETTING
from conespot.results.rows import read_rows
from conespot.results.run import load_run
from conespot.scene import InputError

NEEDED = [column.name for column in COLUMNS if not column.optional]


@pytest.fixture
def frame(make_rows):
    return make_rows(poses=4, powers=(0.25, 1.0), failing=0.3)


@pytest.fixture
def refused(tmp_path, make_run):
    def check(frame, kind="parquet"):
        with pytest.raises(InputError) as caught:
            load_run(make_run(tmp_path / "run", frame, described=[], kind=kind))
        message = str(caught.value)
        assert "\n" not in message
        assert str(tmp_path) in message
        return message

    return check


def test_parquet_and_csv_give_the_same_rows(tmp_path, frame, make_run):
    frame = frame.assign(
        **{"beam.half_angle": "9 deg", "retina.detail": 0.5, "est_sigma_x_mm": np.nan, "est_other": 1.0}
    )
    one = load_run(make_run(tmp_path / "a", frame)).rows
    two = load_run(make_run(tmp_path / "b", frame, kind="csv")).rows
    pd.testing.assert_frame_equal(one.frame, two.frame)
    assert one.swept == two.swept == ("beam.half_angle", "retina.detail")
    assert one.group == (*SETTING, "beam.half_angle", "retina.detail")
    assert list(one.frame.columns) == [*NEEDED, "est_sigma_x_mm", *one.swept]


def test_the_frame_column_may_be_missing_as_in_version_0_1_0(tmp_path, frame, make_run):
    assert "frame" not in load_run(make_run(tmp_path / "old", frame)).rows.frame
    named = load_run(make_run(tmp_path / "new", frame.assign(frame=frame["case"]), kind="csv")).rows
    assert (named.frame["frame"] == named.frame["case"]).all()
    assert named.group == SETTING


def test_parquet_is_read_where_both_stand(tmp_path, frame, make_run):
    folder = make_run(tmp_path / "run", frame)
    (folder / "errors.csv").write_text("nothing")
    assert len(load_run(folder).rows) == len(frame)


def test_reasons_keep_their_commas_quotes_and_lines(tmp_path, frame, make_run):
    frame.loc[frame["status"] == "failed", "reason"] = 'cut, "by"\nthe border'
    read = load_run(make_run(tmp_path / "run", frame, kind="csv")).rows.frame
    assert set(read["reason"]) == {"", 'cut, "by"\nthe border'}


def test_categories_and_nulls_of_other_writers_are_read(tmp_path, frame, make_run):
    frame = frame.astype({name: "category" for name in ("trajectory", "localizer")})
    frame["reason"] = frame["reason"].replace("", None)
    assert len(load_run(make_run(tmp_path / "run", frame)).rows) == len(frame)


@pytest.mark.parametrize("kind", ["parquet", "csv"])
def test_a_missing_column_is_named(frame, kind, refused):
    assert "no column pose, reason" in refused(frame.drop(columns=["pose", "reason"]), kind)


def test_an_unknown_column_is_named(frame, refused):
    assert "unknown column 'seed'" in refused(frame.assign(seed=1))


def test_a_swept_column_without_a_dot_is_known_from_the_campaign(tmp_path, frame, make_run, make_campaign):
    document = make_campaign(sweep=[{"trajectory": ["box"]}, {"seed": [1, 2]}])
    assert load_run(make_run(tmp_path / "run", frame.assign(seed=1), document=document)).rows.swept == ("seed",)


@pytest.mark.parametrize(
    ("column", "value", "said"),
    [
        ("status", "perhaps", "row 1: status must be ok or failed"),
        ("power_w", -1.0, "row 1: power_w must not be negative"),
        ("power_w", np.inf, "row 1: power_w must be a finite number"),
        ("power_w", np.nan, "row 1: power_w must be a finite number"),
        ("resolution_px", 0, "row 1: resolution_px must be a whole number from 1"),
        ("pose", -1, "row 1: pose must be a whole number from 0"),
        ("pose", 0.5, "row 1: pose must be a whole number from 0"),
        ("trajectory", "", "trajectory is ''"),
        ("trajectory", "x" * 300, "trajectory is 'xxx"),
        ("surface", "a\x1b[31m", r"surface is 'a\x1b[31m'"),
        ("localizer", "../../etc", "'../../etc' is no localizer's name"),
        ("localizer", "<script>", "'<script>' is no localizer's name"),
        ("reason", "x" * 2000, "a text of 2000 characters"),
        ("frame", 7, "not text"),
        ("true_in_frame", 1.5, "row 1: true_in_frame must be from 0 to 1"),
        ("est_sigma_x_mm", -0.1, "row 1: est_sigma_x_mm must not be negative"),
        ("power_w", "1 W", "not numbers"),
        ("trajectory", 7, "not text"),
    ],
)
def test_a_wrong_value_is_one_clear_sentence(frame, column, value, said, refused):
    assert said in refused(frame.assign(**{column: value}))


@pytest.mark.parametrize("value", [np.nan, np.inf, 1e12, -1.0])
def test_a_localized_row_has_an_error(frame, value, refused):
    frame = frame[frame["status"] == "ok"].reset_index(drop=True)
    frame.loc[2, "position_error_mm"] = value
    assert "row 3: position_error_mm must" in refused(frame)


def test_a_failed_row_needs_none(tmp_path, frame, make_run):
    frame["status"], frame["error_x_mm"] = "failed", np.nan
    assert len(load_run(make_run(tmp_path / "run", frame)).rows) == len(frame)


def test_a_row_that_stands_twice_would_count_twice(frame, refused):
    assert "stand twice" in refused(pd.concat([frame, frame.iloc[:1]]))


def test_text_where_a_csv_needs_a_number_is_refused(frame, refused):
    assert "errors.csv: cannot be read as csv" in refused(frame.assign(power_w="1 W"), "csv")


@pytest.mark.parametrize("content", [b"", b"PAR1 this is not parquet PAR1", b"\x00" * 64])
@pytest.mark.parametrize("name", ["errors.parquet", "errors.csv"])
def test_garbage_is_refused(tmp_path, name, content, make_run):
    folder = make_run(tmp_path / "run")
    (folder / name).write_bytes(content)
    with pytest.raises(InputError, match=rf"{name}: (cannot be read|no column)"):
        load_run(folder)


@pytest.mark.parametrize(
    ("bound", "said"),
    [
        ("MAX_ROWS", "32 rows of 26 columns are more"),
        ("_MAX_COLUMNS", "32 rows of 26 columns are more"),
        ("_MAX_BYTES", "larger than"),
        ("_MAX_GROUPS", "8 different settings are more"),
    ],
)
def test_what_is_too_large_is_refused(refused, frame, monkeypatch, bound, said):
    monkeypatch.setattr(rows_module, bound, 3)
    assert said in refused(frame)


def test_a_column_of_lists_is_refused_before_it_is_unpacked(frame, refused):
    assert "a column holds lists or records" in refused(frame.assign(est_many=[[0.0] * 1000] * len(frame)))


def test_a_repeated_csv_column_is_refused(tmp_path):
    path = tmp_path / "errors.csv"
    path.write_text("case,case\na,b\n")
    with pytest.raises(InputError, match="stands twice"):
        read_rows(path)


def test_what_is_no_run_folder_says_so(tmp_path, frame, make_run):
    with pytest.raises(InputError, match="no such run folder"):
        load_run(tmp_path / "absent")
    with pytest.raises(InputError, match=r"no campaign\.yaml"):
        load_run(tmp_path)
    with pytest.raises(InputError, match="holds no finished rows"):
        load_run(make_run(tmp_path / "empty", frame.iloc[:0]))
    with pytest.raises(InputError, match="holds no finished rows"):
        load_run(make_run(tmp_path / "none"))


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("half_angle_deg,in_plane_um\n9,0.5\n", "no column distance_3d_um"),
        ("half_angle_deg,in_plane_um,distance_3d_um\n9,x,3\n", "cannot be read as csv"),
        ("half_angle_deg,in_plane_um,distance_3d_um\n9,nan,3\n", "non-negative number"),
        ("half_angle_deg,in_plane_um,distance_3d_um\n", "there must be a row"),
    ],
)
def test_a_wrong_theory_table_is_one_clear_sentence(tmp_path, text, said, make_run):
    folder = make_run(tmp_path / "run")
    (folder / "theory.csv").write_text(text)
    with pytest.raises(InputError, match=said):
        load_run(folder)
