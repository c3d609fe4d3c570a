"""Broken input is valid or refused in one sentence: a little here, by the thousand in `python benchmarks/fuzz.py`."""

import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from mutants import mutated_bytes, mutated_text
from odd_files import odd_files
from strangers_frames import huge_files, scene_of, strangers_file

from conespot.campaigns.plan import make_plan
from conespot.campaigns.schema import read_campaign
from conespot.localize.frames.reader import read_frames
from conespot.render.frame_file import read_frame, write_frame
from conespot.scene import InputError
from conespot.scene.document import shipped

CSV = {
    "trajectory: {kind: csv, file: x.csv}": "x_mm,y_mm,z_mm\n0.5,0,4\n1,-1.25,4\n-1,1.25,5\n",
    "illumination: {kind: csv, file: x.csv}": "nm;power\n500;0,5\n550;7\n600;0\n",
    "surface: {height_map: {kind: csv, file: x.csv, width: 4 mm}}": "1,2,3,4,5\n" * 5,
}
fuzz = settings(max_examples=25, suppress_health_check=[HealthCheck.function_scoped_fixture], print_blob=True)


def valid_or_refused(read, *arguments):
    try:
        read(*arguments)
    except InputError as error:
        assert str(error).isprintable()
        assert len(str(error)) < 1200


@fuzz
@given(st.randoms(use_true_random=False), st.sampled_from(sorted(shipped("campaigns", ""))))
def test_a_mutated_campaign_is_valid_or_refused(tmp_path, moment, name):
    path = tmp_path / "x.yaml"
    path.write_bytes(mutated_text(shipped("campaigns", "")[name].read_text(), moment))
    valid_or_refused(lambda: make_plan(read_campaign(str(path))))


@fuzz
@given(st.randoms(use_true_random=False), st.sampled_from(sorted(CSV)))
def test_a_mutated_csv_file_is_read_or_refused(tmp_path, moment, key):
    (tmp_path / "x.csv").write_bytes(mutated_text(CSV[key], moment))
    scene = "scene: paper\n" if key.startswith("trajectory") else "scene:\n  preset: paper\n  "
    (tmp_path / "c.yaml").write_text(f"{scene}{key}\n{'' if 'trajectory' in key else '#'}\nposes: 1\n")
    valid_or_refused(lambda: make_plan(read_campaign(str(tmp_path / "c.yaml"))))


def test_what_stands_in_a_frames_place_is_read_or_refused_before_it_is_unpacked(tmp_path):
    """Pipes, devices, loops, other formats, and pictures whose few megabytes unpack to gigabytes or for minutes."""
    said = {}
    for path in odd_files(tmp_path, (60, 40)):
        try:
            list(read_frames([path], scene_of("eight.png")))
        except InputError as error:
            said[path.name] = str(error)
    assert all(words.isprintable() for words in said.values())
    assert "go on behind the last row" in said["bomb_data.png"]
    assert "scans, each of which is a picture" in said["scans.jpg"]
    assert "a chunk unpacks to 200000000 bytes" in said["bomb.mcap"]
    assert "a chunk unpacks to 200000000 bytes" in said["lie.mcap"]


@pytest.fixture(scope="module")
def exr(tmp_path_factory):
    path = tmp_path_factory.mktemp("frame") / "x.exr"
    write_frame(path, np.ones((20, 20, 2), np.float32), {"conespot.unit": "W m-2 sr-1"})
    return path.read_bytes()


@fuzz
@given(st.randoms(use_true_random=False))
def test_a_mutated_frame_is_read_or_refused(tmp_path, exr, moment):
    (tmp_path / "x.exr").write_bytes(mutated_bytes(exr, moment))
    valid_or_refused(read_frame, tmp_path / "x.exr")


def test_a_frame_that_claims_more_than_it_can_hold_is_refused_before_it_is_unpacked(tmp_path, exr):
    window = exr.index(b"dataWindow\0box2i\0") + len(b"dataWindow\0box2i\0") + 4
    for side in (19_999, 2**31 - 2):
        huge = exr[: window + 8] + side.to_bytes(4, "little") * 2 + exr[window + 16 :]
        (tmp_path / "x.exr").write_bytes(huge)
        with pytest.raises(InputError, match=r"x.exr: cannot be read as a conespot frame: "):
            read_frame(tmp_path / "x.exr")


@fuzz
@given(st.randoms(use_true_random=False))
def test_an_image_or_a_video_from_outside_is_read_or_refused(tmp_path, capfd, moment):
    path, name = strangers_file(tmp_path, moment)
    valid_or_refused(lambda: list(read_frames([path], scene_of(name))))
    said = capfd.readouterr()
    assert not said.err, "who reads it has one sentence, and no library has another"
    assert not said.out


@pytest.mark.parametrize("name", ["huge.png", "huge.tiff", "huge.jpg"])
def test_a_picture_that_is_huge_by_its_header_is_refused_by_it(tmp_path, name):
    (tmp_path / name).write_bytes(huge_files()[name])
    with pytest.raises(InputError, match="12000 x 12000 px do not fit"):
        list(read_frames([tmp_path / name], scene_of("eight.png")))


@pytest.mark.slow
def test_a_twentieth_of_the_fuzzing_and_the_command_find_no_defect():
    """YAML, CSV, frames, images, videos and damaged run folders, in a process and through the command."""
    script = Path(__file__).parents[2] / "benchmarks" / "fuzz.py"
    command = [sys.executable, str(script), "--seed", "5", "--share", "0.05", "--command", "3", "--seconds", "60"]
    done = subprocess.run(command, capture_output=True, text=True, timeout=600)
    assert done.returncode == 0, done.stdout
