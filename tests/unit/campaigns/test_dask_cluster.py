"""campaigns.dask_cluster: workers of a scheduler in this process. The bench is a fake; what ends workers is slow."""

import contextlib

import pytest
from distributed import LocalCluster

from conespot.campaigns import dask_cluster, dask_crew
from conespot.campaigns.dask_cluster import DaskCluster
from conespot.campaigns.ending import RunError
from conespot.campaigns.plan import make_plan
from conespot.campaigns.profile import Scheduler
from conespot.campaigns.row import Finding, Record
from conespot.campaigns.schema import read_campaign


class FakeBench:
    """Answers at once, or as the file `script` beside the folder of frames has it for a pose of the first group."""

    worn = False
    variant = "fake"

    def __init__(self, plan, frames):
        self.plan, self.frames = plan, frames

    def measure(self, unit):
        group = self.plan.groups[unit.group]
        if unit.group == 0 and unit.pose == 2:
            raise ValueError("no such\nluck")
        names = [] if unit.pose == 3 else [(c.key, n) for c in group.cases for n in c.localizers]
        if self.frames is not None:
            (self.frames / f"{group.cases[0].frame}-{unit.pose:05d}.exr").write_bytes(b"frame")
        findings = [Finding(case=key, localizer=name, reason="fake") for key, name in names]
        if not findings:
            findings = [Finding(case="strange", localizer="paper", reason="fake")]
        return Record(unit=unit.key, findings=findings)


class Other(FakeBench):
    variant = "scalar_spectral"


def lives(plan, frames):
    return FakeBench(plan, frames)


def cannot_start(plan, frames):
    raise RuntimeError("mitsuba 3.10 is installed but 3.9.* is needed")


@pytest.fixture(scope="module")
def scheduler():
    """A scheduler with two workers, all in this process."""
    with LocalCluster(n_workers=2, threads_per_worker=1, processes=False, dashboard_address="127.0.0.1:0") as cluster:
        yield Scheduler(kind="scheduler", address=cluster.scheduler_address)


@pytest.fixture
def plan(tmp_path):
    (tmp_path / "c.yaml").write_text("scene: paper\nposes: 6\nsweep: {scene.surface: [smooth, bumps]}\n")
    return make_plan(read_campaign(str(tmp_path / "c.yaml")))


def do(plan, profile, make=lives, frames=None):
    notes = []
    records = list(DaskCluster(profile, make).execute(plan, plan.units(), frames=frames, note=notes.append))
    return records, notes


def test_every_unit_gives_one_record_and_strange_answers_are_errors(plan, scheduler):
    records, notes = do(plan, scheduler)
    assert sorted(r.unit for r in records) == sorted(u.key for u in plan.units())
    errors = {r.unit: r.error for r in records if r.error}
    first, second = (group.key for group in plan.groups)
    assert errors.keys() == {f"{first}-2", f"{first}-3", f"{second}-3"}
    assert errors[f"{first}-2"].startswith("ValueError: no such luck (test_dask_cluster.py:")
    assert errors[f"{first}-3"] == "what the worker sent is no record of this pose"
    assert notes == []


def test_frames_reach_the_folder_whether_or_not_a_worker_sees_it(plan, scheduler, tmp_path, monkeypatch):
    names = {f"{g.cases[0].frame}-{i:05d}.exr" for g in plan.groups for i in range(6)} - {
        f"{plan.groups[0].cases[0].frame}-00002.exr"
    }
    for folder, sees in ((tmp_path / "shared", True), (tmp_path / "sent", False)):
        folder.mkdir()
        if not sees:
            monkeypatch.setattr(dask_cluster, "_token", lambda frames: contextlib.nullcontext("nowhere"))
        do(plan, scheduler, frames=folder)
        assert {path.name for path in folder.iterdir()} == names


def test_workers_that_cannot_render_end_the_run_with_their_reason(plan, scheduler):
    with pytest.raises(RunError, match="no worker can be used; inproc://.*: cannot render: mitsuba 3.10 is installed"):
        do(plan, scheduler, make=cannot_start)


def test_workers_of_other_software_or_another_variant_are_refused_by_name(plan, scheduler, monkeypatch):
    monkeypatch.setattr(dask_crew, "software", lambda: {"mitsuba": "0.6"})
    with pytest.raises(RunError, match=r"no worker can be used; inproc://.*: it has mitsuba 3\.[\d.]+, not 0\.6; try"):
        do(plan, scheduler)
    monkeypatch.undo()
    stated = scheduler.model_copy(update={"variant": "llvm_ad_spectral"})
    with pytest.raises(RunError, match=r"it renders with fake, not llvm_ad_spectral"):
        do(plan, stated)


def test_a_worker_with_another_variant_than_the_first_is_left_out(plan, scheduler, tmp_path):
    def either(plan, frames):
        try:
            (tmp_path / "first").mkdir()
        except FileExistsError:
            return Other(plan, frames)
        return FakeBench(plan, frames)

    records, notes = do(plan, scheduler, make=either)
    assert len(records) == 12
    assert len(notes) == 1
    assert notes[0].startswith("the worker inproc://")
    assert {"it renders with fake, not scalar_spectral", "it renders with scalar_spectral, not fake"} & {
        notes[0].partition("is not used: ")[2]
    }


def test_nobody_at_the_address_is_a_sentence(plan, monkeypatch):
    nowhere = Scheduler(kind="scheduler", address="tcp://127.0.0.1:9")
    monkeypatch.setattr("conespot.campaigns.cluster._PATIENCE", 0.2)
    with pytest.raises(RunError, match="tcp://127.0.0.1:9: no scheduler to work with: "):
        do(plan, nowhere)
