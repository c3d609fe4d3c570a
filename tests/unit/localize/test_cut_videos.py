"""localize.frames.container: a video that is cut short by its container's word is refused, not half read."""

import numpy as np
import pytest
from film import write_film

from conespot.localize.frames.reader import read_frames
from conespot.scene import InputError, Scene

GREY = np.random.default_rng(1).integers(0, 256, (30, 40), dtype=np.uint8)
LIMITED = {"sensor": {"kind": "recorded", "camera": "srgb8", "range": "limited"}}


def scene(**keys):
    return Scene.model_validate({"camera": {"resolution": [40, 30]}, **keys})


@pytest.mark.parametrize(
    ("name", "codec", "pixels", "kept"),
    [
        ("x.mkv", "ffv1", "gray", 1 / 4),
        ("x.webm", "libvpx", "yuv420p", 1 / 2),
        ("x.mp4", "libx264", "yuv420p", 0.999),
        ("x.mov", "libx264", "yuv420p", 0.999),
        ("x.avi", "mjpeg", "yuvj420p", 1 / 2),
        ("x.y4m", "wrapped_avframe", "gray", 1 / 2),
    ],
)
def test_a_video_that_is_cut_short_is_refused_and_a_whole_one_read_to_its_end(tmp_path, name, codec, pixels, kept):
    film = write_film(tmp_path / name, [GREY] * 12, codec, pixels)
    told = LIMITED if pixels == "yuv420p" else {}
    assert len(list(read_frames([str(film)], scene(**told)))) == 12
    whole = film.read_bytes()
    film.write_bytes(whole[: int(kept * len(whole))])
    with pytest.raises(InputError, match=f"{name}: is cut short: .*; copy or record it again"):
        list(read_frames([film], scene(**told)))


def test_a_live_recordings_matroska_says_no_length_and_is_read_to_its_last_whole_frame(tmp_path):
    film = write_film(tmp_path / "x.mkv", [GREY] * 12)
    whole = film.read_bytes()
    at = whole.index(b"\x18\x53\x80\x67") + 4
    live = whole[:at] + b"\x01" + 7 * b"\xff" + whole[at + 8 :]
    film.write_bytes(live[: len(live) // 2])
    assert 0 < len(list(read_frames([film], scene()))) < 12
    film.write_bytes(live[: live.index(b"\x1f\x43\xb6\x75") + 60])  # within the first cluster
    with pytest.raises(InputError, match="holds no whole frame"):
        list(read_frames([film], scene()))
