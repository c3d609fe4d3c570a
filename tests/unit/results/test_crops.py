"""Crops: what is kept of a frame and what was seen in it, and what a stranger's file may hold."""

import base64
import json

import cv2
import numpy as np
import pytest

from conespot.results.crops import Crops, crop_of, read_crops
from conespot.results.overlay import Overlay
from conespot.results.report.gallery import gallery
from conespot.results.run import load_run
from conespot.scene import InputError


def overlay(size=900):
    turn = np.linspace(0.0, 2.0 * np.pi, 200)
    circle = np.column_stack([450.0 + 200.0 * np.cos(turn), 450.0 + 200.0 * np.sin(turn)])
    rows, columns = np.mgrid[:size, :size] + 0.5
    lit = np.hypot(rows - 450.0, columns - 450.0) < 200.0
    return Overlay(np.where(lit, 255, 20).astype(np.uint8), 255.0, {"true": [circle], "found": []}, lit)


def test_a_crop_is_small_and_its_outline_lies_on_its_patch():
    crop = crop_of("0" * 16, "paper-code", 3, overlay())
    image = cv2.imdecode(np.frombuffer(base64.b64decode(crop.image), np.uint8), cv2.IMREAD_GRAYSCALE)
    assert image.shape == (crop.height, crop.width) == (320, 320)
    x, y = np.array(crop.lines["true"][0]).T
    seen = np.argwhere(image > 137)[:, ::-1] + 0.5
    assert np.allclose([x.min(), x.max(), y.min(), y.max()], [*_span(seen[:, 0]), *_span(seen[:, 1])], atol=1.5)
    assert len(crop.model_dump_json()) < 20_000


def _span(values):
    return values.min() - 0.5, values.max() + 0.5


@pytest.mark.parametrize("image", ['"/><script>alert(1)</script>', "javascript:alert(1)", "A" * 300_000])
def test_a_picture_that_is_none_is_refused(tmp_path, image):
    crop = crop_of("0" * 16, "paper-code", 3, overlay()).model_dump()
    (tmp_path / "crops.json").write_text(json.dumps({"per_box": 1, "crops": [{**crop, "image": image}]}))
    with pytest.raises(InputError, match="holds no crops"):
        read_crops(tmp_path)


def test_a_crop_of_no_row_is_not_shown(tmp_path, make_rows, make_run):
    frame = make_rows(poses=4, powers=(1.0,), trajectories=("box",), rigs=("single",))
    run = load_run(make_run(tmp_path / "run", frame))
    known, unknown = (crop_of("0" * 16, "paper-code", pose, overlay()) for pose in (3, 9))
    shown = gallery(run, Crops(per_box=1, crops=(known, unknown)))
    assert [picture.crop.pose for picture in shown] == [3]
    assert "um" in shown[0].error
