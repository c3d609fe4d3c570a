"""`campaign track`: frames in, a trajectory out; late frames are dropped live and never in a replay."""

import csv

import cv2
import numpy as np
import pytest
from moving import MovingNeedle

from conespot.campaigns import own_track
from conespot.campaigns.answer_row import flat
from conespot.campaigns.command import main
from conespot.campaigns.own_track import OwnTrack
from conespot.localize.distance import Alarm
from conespot.localize.frames.reader import GivenFrame
from conespot.localize.outcome import LocalizationFailure
from conespot.localize.tracking.tracker import State, Tracked
from conespot.scene import InputError
from conespot.scene.document import dump


@pytest.fixture(scope="module")
def film(tmp_path_factory):
    folder = tmp_path_factory.mktemp("film")
    needle = MovingNeedle(300)
    (folder / "scene.yaml").write_text(dump(needle.scene))
    (folder / "frames").mkdir()
    for k in range(4):
        cv2.imwrite(str(folder / "frames" / f"f{k}.png"), needle.frame(k / needle.rate_hz))
    return folder


def test_a_replay_of_a_recording_writes_the_same_trajectory_again_and_smoothing_another(
    film, tmp_path, capsys, monkeypatch
):
    monkeypatch.chdir(film)
    options = ["track", "frames", "--scene", "scene.yaml", "--rate", "120 Hz"]
    recording = str(tmp_path / "a.mcap")
    for name, more in (("a", ["--mcap", recording, "--csv", str(tmp_path / "a.csv")]), ("s", ["--smooth", "3"])):
        assert main([*options, *more, "--tum", str(tmp_path / name)]) == 0
    assert (
        main(
            [
                "track",
                recording,
                "--scene",
                "scene.yaml",
                "--tum",
                str(tmp_path / "b"),
                "--csv",
                str(tmp_path / "b.csv"),
            ]
        )
        == 0
    )
    assert "4 frames: 3 followed, 1 found; " in capsys.readouterr().out
    with open(tmp_path / "a.csv") as first, open(tmp_path / "b.csv") as again:
        rows, replayed = list(csv.DictReader(first)), list(csv.DictReader(again))
    assert [row["state"] for row in rows] == ["found", "followed", "followed", "followed"]
    for row, other in zip(rows, replayed, strict=True):
        assert float(row.pop("latency_s")) > 0.0 < float(other.pop("latency_s"))
        assert {**row, "frame": ""} == {**other, "frame": ""}
    for c in "xyz":
        assert float(rows[3][f"predicted_{c}_mm"]) == pytest.approx(float(rows[3][f"{c}_mm"]), abs=0.3)
    assert rows[0]["predicted_x_mm"] == "" < rows[3]["sigma_predicted_x_mm"]
    first, again, smooth = ((tmp_path / name).read_bytes() for name in "abs")
    assert first == again != smooth
    assert len(first.splitlines()) == len(smooth.splitlines()) == 5


def test_frames_that_others_overtake_are_dropped_live_and_counted(film, monkeypatch):
    """A tracker that takes 2.5 frames' time for each: of four frames it gets the first and the newest one then."""

    class Slow:
        knowns = None

        def __init__(self, *_, **__):
            pass

        def track(self, image, time_s):
            return Tracked(time_s, State.LOST, LocalizationFailure("slow"), None, 2.5 / 120.0)

    monkeypatch.setattr(own_track, "Tracker", Slow)
    for live, times, dropped in ((True, [0.0, 2.0], 1), (False, [0.0, 1.0, 2.0, 3.0], 0)):
        own = OwnTrack(str(film / "scene.yaml"), [], "cone", 120.0, live=live)
        rows = [flat(answer) for answer in own.answers([film / "frames"], Alarm(0.1, 1e-3))]
        assert [(row["status"], row["safe"]) for row in rows if row.get("state") == "dropped"] == [
            ("dropped", "no")
        ] * dropped
        assert len(rows) == len(own.tracked) + dropped
        assert np.round([tracked.time_s * 120.0 for tracked in own.tracked][: len(times)], 6).tolist() == times
        assert own.dropped == dropped


def test_frames_without_times_are_refused_with_the_remedy(film, monkeypatch, capsys):
    monkeypatch.chdir(film)
    assert main(["track", "frames", "--scene", "scene.yaml"]) == 2
    assert "has no time stamp, which tracking needs; give --rate, as '60 Hz'" in capsys.readouterr().err


def test_a_frame_that_is_not_later_than_the_one_before_is_named(film, monkeypatch):
    def reader(*_):
        for k, time_s in enumerate((0.0, 0.0)):
            image = cv2.imread(str(film / "frames" / "f0.png"), cv2.IMREAD_UNCHANGED)
            yield GivenFrame(f"frame {k}", time_s, image)

    monkeypatch.setattr(own_track, "read_frames", reader)
    own = OwnTrack(str(film / "scene.yaml"), [], "cone", None)
    with pytest.raises(InputError, match="frame 1: tracking: a frame at 0 s follows one at 0 s; give them in order"):
        list(own.answers([film], None))
