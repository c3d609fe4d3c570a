"""campaigns.store: a run folder survives torn writes, strangers and second writers."""

import bisect
import errno
import io
import re
import zlib

import pandas as pd
import pytest

from conespot.campaigns.ending import RunError
from conespot.campaigns.journal import FILE, Journal
from conespot.campaigns.maker import maker
from conespot.campaigns.plan import make_plan
from conespot.campaigns.row import Finding, Record
from conespot.campaigns.schema import read_campaign
from conespot.campaigns.store import open_store
from conespot.results.makers import read_makers
from conespot.scene import InputError
from conespot.scene.document import read_document

CAMPAIGN = (
    "scene: paper\nposes: 4\nlocalizers: [paper, paper-code]\nsweep: {scene.power.value: [0.5 W, 1 W], seed: [1, 2]}\n"
)
PASSED_OVER = "the line is passed over, and its pose runs again"


@pytest.fixture
def document(tmp_path):
    (tmp_path / "c.yaml").write_text(CAMPAIGN)
    return read_campaign(str(tmp_path / "c.yaml"))


@pytest.fixture
def plan(document):
    return make_plan(document)


@pytest.fixture
def run(tmp_path):
    return tmp_path / "runs" / "c"


def record(plan, unit):
    """What a bench would answer: every second finding failed, the others off by 0.01 mm."""
    group = plan.groups[unit.group]
    pose = group.pose(unit.pose)
    findings = []
    for i, (case, localizer) in enumerate((c, name) for c in group.cases for name in c.localizers):
        ok = {"apex": (pose.apex + 0.01).tolist(), "axis": pose.axis.tolist()}
        findings.append(Finding(case=case.key, localizer=localizer, **(ok if i % 2 else {"reason": "nothing found"})))
    return Record(unit=unit.key, findings=findings)


def fill(plan, document, run, units):
    with open_store(run, plan, document) as store:
        for unit in units:
            store.append(record(plan, unit))
        store.write_rows()
    return (run / "errors.csv").read_bytes()


def test_rows_stand_in_the_plans_order_whatever_was_finished_first(tmp_path, plan, document):
    units = list(plan.units())
    assert fill(plan, document, tmp_path / "a", units) == fill(plan, document, tmp_path / "b", reversed(units))


def test_csv_and_parquet_hold_the_same_rows(plan, document, run):
    fill(plan, document, run, plan.units())
    rows = pd.read_parquet(run / "errors.parquet")
    pd.testing.assert_frame_equal(
        rows,
        pd.read_csv(
            run / "errors.csv",
            keep_default_na=False,
            na_values={c: [""] for c in rows.columns if c.endswith(("mm", "deg"))},
        ),
        check_dtype=False,
    )
    assert len(rows) == plan.rows == 32
    assert set(rows["status"]) == {"ok", "failed"}
    assert list(rows.columns)[:13] == [
        "case", "frame", "trajectory", "spotlights", "power_w", "illumination", "surface", "sensor", "resolution_px",
        "localizer", "pose", "status", "reason",
    ]  # fmt: skip
    assert list(rows.columns)[-1] == "seed"
    assert rows["position_error_mm"].max() == pytest.approx(0.01 * 3**0.5)


def test_a_covariance_becomes_sigmas_where_there_is_one(plan, document, run):
    covariance = tuple(tuple(float(i == j) * 1e-4 for j in range(5)) for i in range(5))
    with open_store(run, plan, document) as store:
        for unit in plan.units():
            known = [
                f if f.reason else f.model_copy(update={"covariance": covariance}) for f in record(plan, unit).findings
            ]
            store.append(Record(unit=unit.key, findings=known))
        store.write_rows()
    rows = pd.read_parquet(run / "errors.parquet")
    assert rows.loc[rows["status"] == "ok", "est_sigma_x_mm"].unique() == pytest.approx([0.01])
    assert rows.loc[rows["status"] == "failed", "est_sigma_axis_deg"].isna().all()
    assert "est_sigma_roll_deg" not in rows


def test_finished_units_are_found_again(plan, document, run):
    units = list(plan.units())
    fill(plan, document, run, units[:3])
    with open_store(run, plan, document) as store:
        assert set(store.entries) == {u.key for u in units[:3]}


@pytest.mark.parametrize("tail", [b'{"unit":"', b"\0\0\0\0\0", b'{"unit": "x"}', b'{"crc":"00000000","unit":"x'])
def test_a_line_torn_by_a_crash_is_named_kept_and_ended_before_the_next(plan, document, run, tail):
    units = list(plan.units())
    whole = fill(plan, document, run, units[:2])
    journal = run / "journal.jsonl"
    kept = journal.read_bytes()
    journal.write_bytes(kept + tail)
    assert fill(plan, document, run, []) == whole
    assert journal.read_bytes() == kept + tail
    with open_store(run, plan, document) as store:
        assert store.damage == [f"{journal}:3: was torn before its end; {PASSED_OVER}"]
    fill(plan, document, run, units[2:])
    assert journal.read_bytes().startswith(kept + tail + b"\n")
    assert len(journal.read_bytes().splitlines()) == len(units) + 1
    with open_store(run, plan, document) as store:
        assert set(store.entries) == {u.key for u in units}
        assert len(store.damage) == 1


def checked(line):
    """A line as it would stand in a journal, whatever it holds."""
    return b'{"crc":"%08x",%s\n' % (zlib.crc32(line[1:]), line[1:])


@pytest.mark.parametrize(
    ("line", "wrong"),
    [
        (b"\n", "is no line of a journal"),
        (b"not json\n", "is no line of a journal"),
        (b"[]\n", "is no line of a journal"),
        (b"[" * 100_000 + b"\n", "is no line of a journal"),
        (b"\xff\xfe\n", "is no line of a journal"),
        (b'{"crc":"00000000","unit":"KEY","error":"x"}\n', "does not match its checksum"),
        (b'{"unit":"unknown-0","error":"x"}\n', "is no pose of this campaign"),
        (checked(b'{"unit":"unknown-0","error":"x"}'), "is no pose of this campaign"),
        (b'{"unit":"KEY0","error":"x"}\n', "is no pose of this campaign"),
        (b'{"unit":"KEY","findings":[]}\n', "holds no finished pose"),
        (
            b'{"unit":"KEY","findings":[{"case":"c","localizer":"paper","reason":"x"}]}\n',
            "is no pose of this campaign",
        ),
        (b'{"unit":"KEY","error":"x","extra":1}\n', "holds no finished pose"),
        (b'{"unit":"KEY","error":"' + b"x" * 50_000 + b'"}\n', "holds no finished pose"),
        (b'{"crc":"' + b"x" * 2_000_000 + b'"}\n', "is no line of a journal"),
    ],
)
def test_a_line_that_is_no_unit_of_the_campaign_is_named_and_its_unit_runs_again(plan, document, run, line, wrong):
    units = list(plan.units())
    fill(plan, document, run, units[:1])
    journal = run / "journal.jsonl"
    damaged = journal.read_bytes() + line.replace(b"KEY", units[1].key.encode())
    journal.write_bytes(damaged)
    fill(plan, document, run, units[2:])
    with open_store(run, plan, document) as store:
        assert store.damage == [f"{journal}:2: {wrong}; {PASSED_OVER}"]
        assert set(store.entries) == {u.key for u in units} - {units[1].key}
    assert journal.read_bytes().startswith(damaged)


def test_a_bit_flipped_anywhere_in_the_journal_costs_one_pose_and_is_named(tmp_path, plan, document, run):
    """Every byte of a small journal: the sentence names its line, and the rows come back to the same bytes."""
    units = list(plan.units())[:3]
    undisturbed = fill(plan, document, run, units)
    packed = (run / "errors.parquet").read_bytes()
    journal = run / "journal.jsonl"
    whole = journal.read_bytes()
    starts = [0, *(i + 1 for i in range(len(whole)) if whole[i : i + 1] == b"\n")]
    for at in range(len(whole)):
        line = bisect.bisect_right(starts, at)
        flipped = bytearray(whole)
        flipped[at] ^= 1 << at % 8
        opened = Journal(journal, plan, io.BytesIO(flipped))
        assert set(opened.entries) == {u.key for u in units} - {units[line - 1].key}
        assert opened.damage[0].startswith(f"{journal}:{line}: ")
        # an end of a line where there was none makes two of it
        assert len(opened.damage) == 1 + (flipped[at] == ord("\n"))
        if at % 149 == 0:
            journal.write_bytes(flipped)
            assert fill(plan, document, run, [units[line - 1]]) == undisturbed
            assert (run / "errors.parquet").read_bytes() == packed


def test_lines_of_earlier_versions_without_a_checksum_count(plan, document, run):
    units = list(plan.units())
    rows = fill(plan, document, run, units)
    journal = run / "journal.jsonl"
    journal.write_bytes(re.sub(rb'"crc":"[0-9a-f]{8}",', b"", journal.read_bytes()))
    assert fill(plan, document, run, []) == rows


def test_every_record_says_what_it_was_made_with(plan, document, run):
    unit, other = list(plan.units())[:2]
    with open_store(run, plan, document) as store:
        store.append(record(plan, unit))
        store.append(record(plan, other).model_copy(update={"by": "variant scalar_spectral, conespot 0"}))
    with open_store(run, plan, document) as store:
        assert store.entries[unit.key].by == maker()
        assert store.entries[other.key].by == "variant scalar_spectral, conespot 0"
        store.write_rows()
    assert read_makers(run) == {maker(): 1, "variant scalar_spectral, conespot 0": 1}


def test_many_units_are_kept_as_they_are_one_by_one_but_the_disk_is_waited_for_once(
    plan, document, tmp_path, monkeypatch
):
    records = [record(plan, unit) for unit in plan.units()]
    fill(plan, document, tmp_path / "a", plan.units())
    waits = []
    with open_store(tmp_path / "b", plan, document) as store:
        monkeypatch.setattr("os.fsync", waits.append)
        store.extend(records)
        assert len(waits) == 1
        assert store.standing().finished == len(records) == len(store.entries)
    assert (tmp_path / "b" / FILE).read_bytes() == (tmp_path / "a" / FILE).read_bytes()


def test_a_later_record_of_a_unit_replaces_the_error_before_it(plan, document, run):
    unit = next(plan.units())
    with open_store(run, plan, document) as store:
        store.append(Record(unit=unit.key, error="out of memory"))
        store.write_rows()
    assert set(pd.read_csv(run / "errors.csv")["reason"]) == {"out of memory"}
    fill(plan, document, run, [unit])
    assert "out of memory" not in set(pd.read_csv(run / "errors.csv")["reason"])


def test_a_full_disk_keeps_what_is_finished(plan, document, run, monkeypatch):
    units = list(plan.units())

    def full(handle):
        raise OSError(errno.ENOSPC, "No space left on device")

    with open_store(run, plan, document) as store:
        store.append(record(plan, units[0]))
        monkeypatch.setattr("os.fsync", full)
        with pytest.raises(RunError, match="cannot be written: No space left on device; what is finished is kept"):
            store.append(record(plan, units[1]))
        monkeypatch.undo()
        assert set(store.entries) == {units[0].key}


def test_another_campaigns_folder_is_refused_and_left_alone(tmp_path, plan, document, run):
    fill(plan, document, run, plan.units())
    before = {p: p.read_bytes() for p in run.iterdir()}
    (tmp_path / "d.yaml").write_text(CAMPAIGN.replace("poses: 4", "poses: 5"))
    other = read_campaign(str(tmp_path / "d.yaml"))
    with (
        pytest.raises(InputError, match="holds the run of another campaign or other settings; choose another --out"),
        open_store(run, make_plan(other), other),
    ):
        pass
    assert {p: p.read_bytes() for p in run.iterdir()} == before


def test_a_folder_with_other_files_is_refused_and_left_alone(plan, document, run):
    run.mkdir(parents=True)
    (run / "thesis.tex").touch()
    with pytest.raises(InputError, match="is not a run folder; choose another --out"), open_store(run, plan, document):
        pass
    assert [p.name for p in run.iterdir()] == ["thesis.tex"]


def test_a_file_in_the_way_is_refused(plan, document, run):
    run.parent.mkdir()
    run.touch()
    with pytest.raises(InputError, match="is a file, not a run folder"), open_store(run, plan, document):
        pass


def test_a_second_writer_is_refused(plan, document, run):
    with (
        open_store(run, plan, document),
        pytest.raises(InputError, match="another `campaign run` is writing to it"),
        open_store(run, plan, document),
    ):
        pass


def test_the_run_says_what_it_was_made_with_and_is_a_campaign_itself(plan, document, run):
    with open_store(run, plan, document):
        pass
    said = read_document(run / "campaign.yaml").data
    assert said["made_with"]["identity"] == plan.identity
    assert {"conespot", "mitsuba", "numpy", "python", "platform"} <= set(said["made_with"])
    assert said["seed"] == 1
    assert make_plan(read_campaign(str(run / "campaign.yaml"))).identity == plan.identity
