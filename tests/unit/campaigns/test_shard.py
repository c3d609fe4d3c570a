"""campaigns.shard and campaigns.merge: shares of a campaign, and the one run folder that they become."""

import itertools

import pytest
from truth import true_record

from conespot.campaigns.merge import merge
from conespot.campaigns.plan import make_plan
from conespot.campaigns.row import Record
from conespot.campaigns.schema import read_campaign
from conespot.campaigns.session import carry_out
from conespot.campaigns.shard import Shard
from conespot.scene import InputError

TEXT = """\
scene: paper
poses: 7
localizers: [paper, paper-code]
sweep: {scene.power.value: [0.5 W, 1 W], scene.surface: [smooth, bumps]}
"""


class AtOnce:
    """Answers `off` [mm] beside the truth, and loses the poses `loses`."""

    def __init__(self, off=0.0, loses=()):
        self.off, self.loses = off, loses

    def execute(self, plan, units, *, frames, note):
        for unit in units:
            group = plan.groups[unit.group]
            if unit.pose in self.loses:
                yield Record(unit=unit.key, error="lost in thought")
                continue
            if frames is not None:
                (frames / f"{group.cases[0].frame}-{unit.pose:05d}.exr").write_bytes(unit.key.encode())
            yield true_record(plan, unit, off=self.off)


@pytest.fixture
def document(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr("conespot.results.write_results", lambda folder: None)  # only rows are looked at
    (tmp_path / "c.yaml").write_text(TEXT)
    return read_campaign("c.yaml")


@pytest.mark.parametrize("count", [1, 2, 3, 5, 14])
def test_shards_share_all_poses_and_differ_little(document, count):
    plan = make_plan(document)
    shares = [Shard(i + 1, count).units(plan) for i in range(count)]
    assert sorted(u.key for u in itertools.chain(*shares)) == sorted(u.key for u in plan.units())
    assert max(map(len, shares)) - min(map(len, shares)) <= 1
    scenes = [{plan.groups[unit.group].scene_key for unit in share} for share in shares]
    assert sum(map(len, scenes)) <= count + 1


@pytest.mark.parametrize("text", ["0/4", "5/4", "2", "a/b", "1/0", "1/99999", "٢/٤", "-1/4"])
def test_a_shard_that_is_none_is_refused(text):
    with pytest.raises(InputError, match="write I/N with 1 <= I <= N"):
        Shard.of(text)


def test_more_shards_than_poses_are_refused(document):
    with pytest.raises(InputError, match=r"--shard 2/99: no pose falls to it, since there are 14"):
        [Shard(i + 1, 99).units(make_plan(document)) for i in range(2)]


def rows(folder):
    return (folder / "errors.parquet").read_bytes(), (folder / "errors.csv").read_bytes()


def test_merged_shards_are_the_run_of_one_process_to_the_byte(document, tmp_path):
    (tmp_path / "c.yaml").write_text(TEXT + "frames: true\n")
    document = read_campaign("c.yaml")
    whole = carry_out(document, None, AtOnce()).folder
    shards = [carry_out(document, None, AtOnce(), Shard(i, 3)).folder for i in (1, 2, 3)]
    assert [str(shard) for shard in shards] == ["runs/c-1-of-3", "runs/c-2-of-3", "runs/c-3-of-3"]
    merged = merge(tmp_path / "merged", shards[::-1])
    assert merged.missing == ()
    assert rows(tmp_path / "merged") == rows(whole)
    frames = {path.name: path.read_bytes() for path in (whole / "frames").iterdir()}
    assert {path.name: path.read_bytes() for path in (tmp_path / "merged" / "frames").iterdir()} == frames


def test_what_is_missing_is_said_and_comes_by_merging_again_or_by_running_on(document, tmp_path):
    first, last = (carry_out(document, None, AtOnce(), Shard(i, 3)).folder for i in (1, 3))
    second = carry_out(document, None, AtOnce(loses=[6]), Shard(2, 3)).folder
    out = tmp_path / "merged"
    merged = merge(out, [first, last])
    assert len(merged.missing) == 5
    assert "5 of 14 poses are missing, the first: pose 5 of box, single, smooth; merge again" in merged.sentence
    assert len(merge(out, [second]).missing) == 1
    session = carry_out(read_campaign(str(out / "campaign.yaml")), out, AtOnce())
    assert session.lost == ()
    assert rows(out) == rows(carry_out(document, tmp_path / "whole", AtOnce()).folder)


def test_shards_that_contradict_are_refused_before_anything_is_merged(document, tmp_path):
    one = carry_out(document, tmp_path / "one", AtOnce(), Shard(1, 2)).folder
    other = carry_out(document, tmp_path / "other", AtOnce(off=1e-9), Shard(1, 2)).folder
    with pytest.raises(InputError, match=r"one and .*other: found different things at pose 0 of box, single, smooth"):
        merge(tmp_path / "merged", [one, other])
    assert (tmp_path / "merged" / "journal.jsonl").read_bytes() == b""


def test_folders_of_other_campaigns_and_other_folders_are_refused(document, tmp_path):
    one = carry_out(document, tmp_path / "one", AtOnce(), Shard(1, 2)).folder
    (tmp_path / "c.yaml").write_text(TEXT + "seed: 2\n")
    other = carry_out(read_campaign("c.yaml"), tmp_path / "other", AtOnce(), Shard(2, 2)).folder
    with pytest.raises(InputError, match="other: holds the run of another campaign or other settings"):
        merge(tmp_path / "merged", [one, other])
    with pytest.raises(InputError, match="nothing: is no run folder"):
        merge(tmp_path / "merged", [one, tmp_path / "nothing"])
    assert not (tmp_path / "merged").exists()
