"""Several cameras that look at one scene at the same instant."""

import pytest

from conespot.campaigns.plan import make_plan
from conespot.campaigns.schema import read_campaign
from conespot.scene import InputError, load_scene
from conespot.scene.identity import identity

PAIR = """preset: paper-code
cameras:
  left: {resolution: [1920, 1080], height: 180 mm, tilt: 3.5 deg, azimuth: 180 deg}
  right: {resolution: [1920, 1080], height: 180 mm, tilt: 3.5 deg}
"""


def written(folder, text):
    (folder / "mine.yaml").write_text(text)
    return folder / "mine.yaml"


def test_a_scene_is_seen_through_the_camera_it_names_and_through_any_other(tmp_path):
    scene = load_scene(written(tmp_path, PAIR + "camera: left\n"))
    right = scene.through("right")
    assert scene.camera == scene.cameras["left"]
    assert scene.camera.centre[0] == pytest.approx(-right.camera.centre[0])
    assert right.model_copy(update={"camera": scene.camera}) == scene
    assert load_scene(written(tmp_path, PAIR + "camera: right\n")) == right
    assert identity(scene) != identity(right)


@pytest.mark.parametrize(
    ("camera", "said"),
    [("camera: lift\n", "unknown camera 'lift'; did you mean 'left'?"), ("", "name of one of cameras: left, right")],
)
def test_a_camera_beside_the_cameras_is_refused(tmp_path, camera, said):
    with pytest.raises(InputError, match="mine.yaml") as error:
        load_scene(written(tmp_path, PAIR + camera))
    assert said in str(error.value)


def test_a_sweep_over_the_cameras_gives_both_frames_of_every_pose(tmp_path):
    text = "".join(f"  {line}\n" for line in (PAIR + "camera: left").splitlines())
    text = f"scene:\n{text}trajectory: random\nposes: 3\nsweep: {{scene.camera: [left, right]}}\n"
    plan = make_plan(read_campaign(str(written(tmp_path, text))))
    assert [case.swept for case in plan.cases] == [{"scene.camera": "left"}, {"scene.camera": "right"}]
    left, right = plan.groups
    assert (left.positions == right.positions).all()
    assert left.scene.through("right").camera == right.scene.camera
