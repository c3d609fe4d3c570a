"""Frames on disk: what is read is what was written, with its provenance."""

from __future__ import annotations

import numpy as np
import pytest

from conespot.render.frame_file import frame_header, read_frame, write_frame, write_preview
from conespot.scene import InputError, load_scene


def test_an_exr_frame_reads_back_to_the_bit_with_its_header(tmp_path):
    scene = load_scene("paper-code")
    pose = scene.pose(np.array([0.0, 2.0, 2.0]))
    radiance = np.random.default_rng(0).random((20, 20, 3)).astype(np.float32) * 100
    header = frame_header(scene, pose, 0.25, {"mitsuba": "3.9.1"})
    write_frame(tmp_path / "a.exr", radiance, header)
    read, found = read_frame(tmp_path / "a.exr")
    np.testing.assert_array_equal(read, radiance)
    assert found["conespot.power_w"] == pytest.approx(0.25)
    assert found["conespot.power_convention"] == "isotropic"
    assert found["conespot.wavelengths_nm"] == "400 700"
    assert found["conespot.version.mitsuba"] == "3.9.1"
    assert [float(c) for c in found["conespot.apex_mm"].split()] == [0.0, 2.0, 2.0]
    assert list(tmp_path.iterdir()) == [tmp_path / "a.exr"]


def test_a_single_channel_frame_is_named_y(tmp_path):
    write_frame(tmp_path / "a.exr", np.ones((8, 8, 1), np.float32), {})
    assert read_frame(tmp_path / "a.exr")[0].shape == (8, 8, 1)


def test_something_else_is_refused_as_a_frame(tmp_path):
    (tmp_path / "a.exr").write_bytes(b"\x76\x2f\x31\x01 not really")
    with pytest.raises(InputError, match=r"a\.exr: cannot be read"):
        read_frame(tmp_path / "a.exr")


def test_a_frame_in_a_missing_folder_is_refused_and_leaves_nothing(tmp_path):
    with pytest.raises(InputError, match="cannot be written"):
        write_frame(tmp_path / "none" / "a.exr", np.ones((8, 8, 1), np.float32), {})
    assert not list(tmp_path.iterdir())


def test_a_preview_keeps_white_white_and_colours_in_order(tmp_path):
    import cv2

    image = np.zeros((16, 16, 3), np.uint16)
    image[..., 0] = 4095
    write_preview(tmp_path / "a.png", image, 4095)
    assert cv2.imread(str(tmp_path / "a.png"))[0, 0].tolist() == [0, 0, 255]
