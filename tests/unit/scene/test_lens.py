"""A lens as a file describes it, and what it does to the camera's rays."""

import math

import numpy as np
import pytest

from conespot.scene import Camera, InputError, Scene, load_scene
from conespot.scene.document import Document
from conespot.scene.identity import identity
from conespot.scene.lens import Lens
from conespot.scene.optics import Optics
from conespot.scene.point_spread import GaussianSpread, TabulatedSpread
from conespot.scene.scene import read_scene
from conespot.scene.vignetting import seen_whole
from conespot.scene.words import assumed


def scene_with(lens, folder=".", **camera):
    return read_scene(Document("a.yaml", {"camera": {"resolution": 400, **camera, "lens": lens}}, folder=folder))


def test_without_a_lens_a_scene_keeps_its_address():
    """`none` and no key at all are one scene; a lens is another."""
    plain = read_scene(Document("a.yaml", {"camera": {"resolution": 400}}))
    assert identity(scene_with("none")) == identity(plain)
    assert identity(scene_with({"aperture": "8 mm"})) != identity(plain)


def test_a_blur_is_a_length_a_profile_or_a_file(tmp_path):
    """One Gaussian and one profile, each written in two ways; what is read is written back and read again."""
    assert scene_with({"blur": "5 um"}).camera.lens.blur == GaussianSpread(sigma=0.005)
    assert scene_with({"blur": "0 um"}).camera.lens.blur is None
    (tmp_path / "psf.csv").write_text("radius um,value\n0,1\n4,0.5\n10,0\n")
    profile = TabulatedSpread(radii=(0.0, 0.004, 0.01), values=(1.0, 0.5, 0.0))
    written = {"radii": ["0 um", "4 um", "10 um"], "values": [1, 0.5, 0]}
    for blur in ({"file": "psf.csv"}, written):
        scene = scene_with({"blur": blur}, tmp_path)
        assert scene.camera.lens.blur.radii == pytest.approx(profile.radii)
        assert scene.camera.lens.blur.values == profile.values
    again = read_scene(Document("b.yaml", {"camera": scene.camera.model_dump(mode="json")}))
    assert identity(again) == identity(scene)


@pytest.mark.parametrize(
    ("lens", "said"),
    [
        ({"aperture": "-1 mm"}, "greater than or equal to 0"),
        ({"aperture": "8 mm", "numerical_aperture": 0.04}, "give only one of the two"),
        ({"aperture": "200 mm"}, "wider than the working distance is long"),
        ({"numerical_aperture": 0.9}, "wider than the working distance is long"),
        ({"aperture": "8 mm", "focus": "-3 mm"}, "-3 mm is behind the eye"),
        ({"aperture": "8 mm", "focus": "30 mm"}, "30 mm is in front of the eye"),
        ({"glare": 1.0}, "less than 1"),
        ({"blur": "-5 um"}, "greater than 0"),
        ({"blur": 5}, "has no unit"),
        ({"blur": {"radii": ["0 um", "4 um"], "values": [1]}}, "values"),
        ({"blur": {"radii": ["1 um", "4 um"], "values": [1, 0]}}, "begin at 0"),
        ({"blur": {"radii": ["0 um", "4 um"], "values": [0, 0]}}, "zero everywhere"),
        ({"blur": {"file": "no.csv"}}, "no.csv: cannot be read"),
        ({"apertur": "8 mm"}, "did you mean 'aperture'"),
    ],
)
def test_a_lens_that_cannot_be_is_refused_in_one_sentence(lens, said):
    """Everything that a lens may not be, in a scene's file."""
    with pytest.raises(InputError, match="^a.yaml") as refused:
        scene_with(lens)
    assert said in str(refused.value)
    assert "\n" not in str(refused.value)


def test_a_numerical_aperture_is_that_of_the_working_distance():
    """Sine of the angle between the axis and a ray to the pupil's rim, against the pupil's diameter."""
    camera = Camera(height=180.0, lens=Lens(numerical_aperture=0.05))
    assert camera.pupil == pytest.approx(2.0 * 180.0 * math.tan(math.asin(0.05)))


@pytest.mark.parametrize("focus", [0.0, 1.5])
@pytest.mark.parametrize("tilt", [0.0, 0.1])
def test_rays_through_the_pupil_meet_in_the_plane_in_focus(focus, tilt):
    """In the air all rays of a pixel meet in the plane through `focus`, against the ray through the pinhole."""
    camera = Camera(resolution=400, tilt=tilt, azimuth=0.7, roll=0.3, lens=Lens(aperture=12.0, focus=focus))
    pixels = np.random.default_rng(0).uniform(0.0, 400.0, (20, 2))
    chief = camera.rays(pixels)
    depth = 1.0 / camera.vergence
    met = chief.origins + chief.directions * (-depth / (chief.directions @ camera.axes[2]))[:, None]
    assert (met[0] - [0.0, 0.0, focus]) @ camera.axes[2] == pytest.approx(0.0, abs=1e-9)
    for place in ([6.0, 0.0], [0.0, -6.0], [-3.0, 4.0]):
        rays = camera.rays(pixels, pupil=place)
        beside = np.cross(met - rays.origins, rays.directions)
        assert np.abs(beside).max() < 1e-10
        assert (rays.origins - camera.centre) @ camera.axes.T == pytest.approx(np.array([*place, 0.0]))


@pytest.mark.parametrize("focus", [0.0, 0.5, 2.0])
def test_through_the_eyes_optics_the_stated_height_is_sharp(focus):
    """Behind a flat contact lens: of points on the axis the one in focus is seen sharpest, to 1 % of 1 mm's blur."""
    camera = Camera(resolution=1000, optics=Optics(contact="flat"), lens=Lens(aperture=4.0, focus=focus))
    points = np.array([[0.0, 0.0, focus], [0.0, 0.0, focus + 1.0]])
    sharp, beside = camera.confusion(points)
    assert sharp < 0.01 * beside


def test_circle_of_confusion_of_points_in_the_air_is_the_geometric_one():
    """Radius in pixels against f a |1/s - 1/z|, for points beside the axis and in front of and behind the focus."""
    camera = Camera(resolution=1000, lens=Lens(aperture=9.0, focus=1.0))
    points = np.array([[0.0, 0.0, 0.0], [3.0, -2.0, 0.6], [1.0, 1.0, 3.0]])
    expected = camera.focal_length_px * 4.5 * np.abs(1.0 / 109.0 - 1.0 / (110.0 - points[:, 2]))
    assert camera.confusion(points) == pytest.approx(expected, rel=1e-4)
    assert np.all(Camera().confusion(points) == 0.0)


def test_plans_and_tables_state_the_lens():
    """The words beside a number, with and without a lens."""
    lens = Lens(aperture=10.0, blur=GaussianSpread(sigma=0.005), glare=0.02)
    words = assumed(Scene(camera=Camera(lens=lens)))["transfer"]
    assert words.endswith("behind a lens: aperture 10 mm, focus 0 mm, blur of sigma 5 um, glare 2 %")
    assert "lens" not in assumed(Scene())["transfer"]


def test_a_pixel_is_seen_whole_where_the_iris_stops_no_ray_of_the_lens():
    """Against rays through places all over the pupil's rim, half a pixel from the line between the two aside."""
    camera = load_scene("theatre").camera.with_columns(480)
    pixels = np.random.default_rng(0).uniform(0.0, camera.shape[::-1], (400, 2))
    turn = np.linspace(0.0, 2.0 * np.pi, 48, endpoint=False)
    places = camera.pupil / 2.0 * np.stack([np.cos(turn), np.sin(turn)], axis=1)

    def stopped(beside):
        at = np.broadcast_to(pixels + beside, (48, *pixels.shape))
        return np.isnan(camera.rays(at, pupil=places[:, None]).directions[..., 0]).any(axis=0)

    cut = [stopped(np.array(beside)) for beside in ((-0.5, -0.5), (0.5, -0.5), (-0.5, 0.5), (0.5, 0.5))]
    sure = np.all(cut, axis=0) | ~np.any(cut, axis=0)
    found = seen_whole(camera, pixels)
    assert np.mean(sure) > 0.95
    assert np.array_equal(found[sure], ~cut[0][sure])
    assert 0.1 < np.mean(found) < 0.9
    # the ray through the middle goes on farther
    assert np.mean(camera.shows(pixels)) > np.mean(found) + 0.05


def test_without_iris_or_aperture_every_pixel_is_seen_whole():
    """Also those beyond the frame."""
    pixels = np.array([[-50.0, 20.0], [300.0, 200.0]])
    for camera in (Camera(resolution=400, lens=Lens(aperture=9.0)), Camera(resolution=400, optics=Optics())):
        assert seen_whole(camera, pixels).all()
