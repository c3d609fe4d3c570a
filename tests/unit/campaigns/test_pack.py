"""A packed run: the same to the byte, read by others, proven by checksums, by its journal and by measuring again."""

import contextlib
import io
import json
import re
import shutil
import stat
import subprocess
import warnings
import zipfile
import zlib
from dataclasses import dataclass

import pytest
from truth import true_record

from conespot.campaigns.archive import MANIFEST, Archive, write_archive
from conespot.campaigns.crate import FILE as CRATE
from conespot.campaigns.pack import pack
from conespot.campaigns.plan import make_plan
from conespot.campaigns.schema import read_campaign
from conespot.campaigns.store import open_store
from conespot.campaigns.verify import verify
from conespot.scene import InputError

TEXT = """\
name: packed
description: a run with <angles> & "quotes"
scene: {preset: paper-code, camera: {resolution: 300}}
trajectory: {kind: csv, file: tips.csv}
poses: 3
localizers: [paper-code, cone]
sweep: {scene.power.value: [0.5 W, 1 W]}
"""


@dataclass
class Truth:
    """An executor that finds the truth, off by so much at one pose."""

    off: float = 0.0
    pose: int = 1
    by: str = ""

    def execute(self, plan, units, *, frames, note):
        for unit in units:
            yield true_record(plan, unit, off=self.off if unit.pose == self.pose else 0.0, by=self.by or "maker 1")


@pytest.fixture
def run(tmp_path):
    """A finished run of three poses, with rows."""
    home = tmp_path / "home"
    home.mkdir()
    (home / "tips.csv").write_text("x_mm,y_mm,z_mm\n0,0,3\n1,0,3\n1,1,4\n")
    (home / "c.yaml").write_text(TEXT)
    document = read_campaign(str(home / "c.yaml"))
    plan = make_plan(document)
    with open_store(home / "run", plan, document) as store:
        for record in Truth().execute(plan, plan.units(), frames=None, note=print):
            store.append(record)
        store.write_rows()
    return home / "run"


@pytest.fixture
def packed(run, tmp_path):
    """Its archive; nothing else is left of it."""
    pack(run, tmp_path / "run.zip")
    shutil.rmtree(run.parent)
    return tmp_path / "run.zip"


def changed(path, edit, *, honest=True):
    """The archive with its files edited; with a manifest that is right again if the edit is meant to look `honest`."""
    with zipfile.ZipFile(path) as old:
        files = {name: old.read(name) for name in old.namelist()}
    manifest = files.pop(MANIFEST)
    edit(files)
    out = io.BytesIO()
    write_archive(out, files)
    if not honest:
        with zipfile.ZipFile(io.BytesIO(out.getvalue())) as new, zipfile.ZipFile(path, "w") as target:
            for name in new.namelist():
                target.writestr(name, manifest if name == MANIFEST else new.read(name))
        return path
    path.write_bytes(out.getvalue())
    return path


def test_the_same_run_is_packed_to_the_same_bytes(run, tmp_path):
    for name in ("a.zip", "b.zip"):
        said = pack(run, tmp_path / name)
    assert (tmp_path / "a.zip").read_bytes() == (tmp_path / "b.zip").read_bytes()
    assert re.search(r"sha256 [0-9a-f]{64}$", said)


def test_what_was_packed_holds_far_from_where_it_was_measured(packed):
    verdict = verify(packed, 2, 7, Truth())
    assert verdict.wrong == []
    assert "12 rows of errors.csv follow from 3 poses of the journal" in verdict.said
    assert "2 of 3 poses measured again (--seed 7): 8 of 8 answers are the same to the bit" in verdict.said


def test_checksums_are_those_of_coreutils(packed, tmp_path):
    with zipfile.ZipFile(packed) as archive:
        archive.extractall(tmp_path / "unpacked")
    done = subprocess.run(["sha256sum", "-c", "--quiet", MANIFEST], cwd=tmp_path / "unpacked", check=False)
    assert done.returncode == 0


def test_the_metadata_is_a_crate_that_an_independent_reader_takes(packed, tmp_path):
    rocrate = pytest.importorskip("rocrate.rocrate")
    with zipfile.ZipFile(packed) as archive:
        archive.extractall(tmp_path / "unpacked")
    crate = rocrate.ROCrate(tmp_path / "unpacked")
    assert crate.name == "packed"
    assert crate.root_dataset["description"] == 'a run with <angles> & "quotes"'
    files = {entity.id for entity in crate.data_entities}
    stored = {path.relative_to(tmp_path / "unpacked").as_posix() for path in (tmp_path / "unpacked").rglob("*.*")}
    assert files == stored - {MANIFEST, CRATE}
    assert json.loads((tmp_path / "unpacked" / CRATE).read_text())["@graph"][2]["description"] == "3 poses: maker 1"


def test_every_changed_byte_is_found(packed):
    data = packed.read_bytes()
    with zipfile.ZipFile(packed) as archive:
        heads = [(e.header_offset, len(e.filename), e.compress_size) for e in archive.infolist()]
    spans = [(at + 30 + name + int.from_bytes(data[at + 28 : at + 30], "little"), size) for at, name, size in heads]
    for start, size in spans:
        hurt = bytearray(data)
        hurt[start + size // 2] ^= 1
        packed.write_bytes(hurt)
        with contextlib.suppress(InputError):  # the manifest itself may be what cannot be read
            assert verify(packed, 0, 1, Truth()).wrong, start


def test_a_file_that_was_changed_added_or_taken_away_is_named(packed):
    keep = packed.read_bytes()
    for edit, said in (
        (lambda files: files.update({"boxes.csv": b"1"}), "boxes.csv: does not stand in the manifest"),
        (lambda files: files.pop("makers.json"), "makers.json: stands in the manifest and is missing"),
        (lambda files: files.update({"errors.csv": b"1"}), "errors.csv: is not what its checksum says"),
    ):
        packed.write_bytes(keep)
        assert verify(changed(packed, edit, honest=False), 0, 1, Truth()).wrong == [said]


def test_a_changed_row_is_found_whatever_the_checksums_say(packed):
    def flatter(files):
        lines = files["errors.csv"].decode().splitlines()
        names, cells = lines[0].split(","), lines[3].split(",")
        cells[names.index("position_error_mm")] = "0.0001"
        lines[3] = ",".join(cells)
        files["errors.csv"] = ("\n".join(lines) + "\n").encode()

    (wrong,) = verify(changed(packed, flatter), 0, 1, Truth()).wrong
    assert wrong.startswith("errors.csv: row 3 (paper-code, pose 2 of case ")
    assert wrong.endswith("differs from the journal in position_error_mm")


def test_a_row_that_was_left_out_is_found(packed):
    verdict = verify(
        changed(
            packed,
            lambda f: f.update({"errors.csv": f["errors.csv"].rpartition(b"\n")[0].rpartition(b"\n")[0] + b"\n"}),
        ),
        0,
        1,
        Truth(),
    )
    assert verdict.wrong == ["errors.csv: 11 rows, where the journal says 12"]


def test_a_pose_that_was_made_up_is_found_when_it_is_measured_again(packed):
    """Journal, rows and checksums agree; only the measurement does not."""
    verdict = verify(packed, 3, 1, Truth(off=1e-6))
    assert len(verdict.wrong) == 4  # two powers, two localizers
    assert "the same program must find the same" in verdict.wrong[0]
    other = verify(packed, 3, 1, Truth(off=1e-6, by="variant other, maker 2"))
    assert other.wrong == []
    assert "8 of 12 answers are the same to the bit, the others up to 0.00173 um off" in other.said[-1]
    far = verify(packed, 3, 1, Truth(off=1.0, by="variant other, maker 2"))
    assert "300 um are allowed" in far.wrong[0]


def test_a_line_of_the_journal_that_was_changed_is_found(packed):
    def edit(files):
        files["journal.jsonl"] = files["journal.jsonl"].replace(b"paper-code", b"paper-kode", 1)

    wrong = verify(changed(packed, edit), 0, 1, Truth()).wrong
    assert wrong[0].startswith("journal.jsonl:1: ")


def hostile(path, name="x", content=b"y", mode=stat.S_IFREG, **fields):
    entry = zipfile.ZipInfo(name)
    entry.external_attr, entry.create_system = (mode | 0o644) << 16, 3
    entry.compress_type = zipfile.ZIP_DEFLATED
    with zipfile.ZipFile(path, "a") as archive, warnings.catch_warnings():
        warnings.simplefilter("ignore")
        archive.writestr(entry, content)
    return path


@pytest.mark.parametrize(
    ("name", "content", "mode", "said"),
    [
        ("../out", b"", stat.S_IFREG, "leads out of the folder"),
        ("/etc/out", b"", stat.S_IFREG, "leads out of the folder"),
        ("a/../../out", b"", stat.S_IFREG, "leads out of the folder"),
        ("a\\out", b"", stat.S_IFREG, "leads out of the folder"),
        ("C:out", b"", stat.S_IFREG, "leads out of the folder"),
        ("a\x1bout", b"", stat.S_IFREG, "leads out of the folder"),
        ("a//out", b"", stat.S_IFREG, "is no plain path"),
        ("link", b"/etc/passwd", stat.S_IFLNK, "is a link"),
        ("pipe", b"", stat.S_IFIFO, "is a link or no plain file"),
        ("ERRORS.csv", b"", stat.S_IFREG, "stands twice"),
        ("bomb", bytes(40_000_000), stat.S_IFREG, "unpacks to more than 500 times its size"),
    ],
)
def test_an_archive_that_may_do_harm_is_refused_in_a_sentence(packed, tmp_path, name, content, mode, said):
    before = sorted(tmp_path.rglob("*"))
    with pytest.raises(InputError, match=re.escape(said)) as refused:
        verify(hostile(packed, name, content, mode), 0, 1, Truth())
    assert len(str(refused.value).splitlines()) == 1
    assert sorted(tmp_path.rglob("*")) == before


def test_a_campaign_that_names_a_file_outside_is_refused(packed):
    named = rb"inputs/\w+\.csv|/etc/passwd|\.\./.*passwd|inputs/\.\./.*x"
    for name in (b"/etc/passwd", b"../../etc/passwd", b"inputs/../../x", b"inputs/none.csv"):

        def elsewhere(files, name=name):
            files["campaign.yaml"] = re.sub(named, name, files["campaign.yaml"])

        with pytest.raises(InputError, match="none of the archive's inputs"):
            verify(changed(packed, elsewhere), 0, 1, Truth())


def test_a_campaign_that_this_version_cannot_read_is_refused_with_its_place_in_the_archive(packed):
    edit = lambda f: f.update({"campaign.yaml": b"newer: 1\n" + f["campaign.yaml"]})  # noqa: E731
    with pytest.raises(InputError, match=r"run\.zip, campaign\.yaml:1: newer: unknown key"):
        verify(changed(packed, edit), 0, 1, Truth())


def test_a_campaign_that_is_another_one_than_it_states_is_refused(packed):
    edit = lambda f: f.update({"campaign.yaml": f["campaign.yaml"].replace(b"seed: 1", b"seed: 2")})  # noqa: E731
    with pytest.raises(InputError, match="is not the one that it states"):
        verify(changed(packed, edit), 0, 1, Truth())


@pytest.mark.parametrize("content", [b"", b"PK\x03\x04", b"not a zip", bytes(1000)])
def test_what_is_no_archive_is_refused(tmp_path, content):
    (tmp_path / "a.zip").write_bytes(content)
    with pytest.raises(InputError, match="is no archive"):
        Archive(tmp_path / "a.zip")
    with pytest.raises(InputError, match="no such archive"):
        Archive(tmp_path / "b.zip")


def test_a_zip_of_something_else_and_one_cut_short_are_refused(packed, tmp_path):
    with zipfile.ZipFile(tmp_path / "b.zip", "w") as archive:
        archive.writestr("a", "b")
    with pytest.raises(InputError, match="not packed by `campaign pack`"):
        Archive(tmp_path / "b.zip")
    packed.write_bytes(packed.read_bytes()[:-200])
    with pytest.raises(InputError, match="is no archive"):
        Archive(packed)


def test_a_file_that_holds_more_than_it_states_is_damage_and_not_unpacked(tmp_path):
    path = tmp_path / "a.zip"
    with open(path, "wb") as stream:
        write_archive(stream, {"a.txt": b"a" * 100})
    data = path.read_bytes()
    # both headers state ten bytes, with the checksum of these
    for mark, at in ((b"PK\x03\x04", 14), (b"PK\x01\x02", 16)):
        start = data.index(mark) + at
        lie = zlib.crc32(b"a" * 10).to_bytes(4, "little") + data[start + 4 : start + 8] + (10).to_bytes(4, "little")
        data = data[:start] + lie + data[start + 12 :]
    path.write_bytes(data)
    assert list(Archive(path).damage())


def test_what_is_no_run_is_not_packed_and_links_are_not_followed(run, tmp_path):
    with pytest.raises(InputError, match="is no run folder"):
        pack(tmp_path, None)
    (run / "figures").mkdir(exist_ok=True)
    (run / "figures" / "link.png").symlink_to("/etc/passwd")
    with pytest.raises(InputError, match=r"link\.png: is a link"):
        pack(run, None)
    assert not (run.parent / "run.zip").exists()
