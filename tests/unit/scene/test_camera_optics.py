"""The camera that looks through the eye's optics: rays, their inverse, and scenes that cannot be seen."""

import numpy as np
import pytest

from conespot.scene import Camera, InputError, load_scene
from conespot.scene.dispersion import seen_light
from conespot.scene.document import Document
from conespot.scene.fundus import SITES
from conespot.scene.optics import Optics
from conespot.scene.scene import Scene, read_scene

EYES = {
    "phakic": Optics(),
    "aphakic": Optics(lens="aphakic"),
    "flat": Optics(contact="flat"),
    "aphakic flat": Optics(lens="aphakic", contact="flat"),
    "myopic": Optics(eye="atchison", lens="pseudophakic", contact="flat", refraction=-4.0),
}


def scene_of(**camera):
    return read_scene(Document("test", {"eye": {"radius": "12 mm"}, "camera": {"resolution": 400, **camera}}))


def places(camera, count=300, seed=0):
    rows, columns = camera.shape
    return np.random.default_rng(seed).uniform([0.0, 0.0], [columns, rows], (count, 2))


def test_without_optics_the_rays_are_those_of_the_pinhole():
    pixels = places(Camera())
    camera, told = Camera(), Camera().seeing(850.0)
    for part, same in zip(vars(camera.rays(pixels)).values(), vars(told.rays(pixels)).values(), strict=True):
        np.testing.assert_array_equal(part, same)
    away = (pixels - 2500.0) * [1.0, -1.0] / camera.focal_length_px
    expected = np.column_stack([away, -np.ones(len(away))])
    np.testing.assert_allclose(
        camera.rays(pixels).directions, expected / np.linalg.norm(expected, axis=1)[:, None], rtol=0.0, atol=1e-9
    )


@pytest.mark.parametrize("name", ["aphakic", "flat", "aphakic flat", "myopic"])
@pytest.mark.parametrize("wavelength", [480.0, 850.0])
def test_projecting_inverts_rays_through_the_optics(name, wavelength):
    """A point on the ray of a pixel, 14 mm behind where it enters the vitreous, is projected onto it: to 1e-6 px."""
    camera = Camera(optics=EYES[name]).seeing(wavelength)
    pixels = places(camera)
    rays = camera.rays(pixels)
    seen = np.isfinite(rays.directions[:, 0])
    assert 0.2 < seen.mean() < 0.8
    found = camera.project(rays.origins + 14.0 * rays.directions)
    np.testing.assert_allclose(found[seen], pixels[seen], rtol=0.0, atol=1e-6)
    assert np.all(np.isnan(found[~seen]))


def test_where_a_phakic_eye_folds_the_image_the_inner_place_is_found():
    """Without a contact lens spherical aberration turns rays back at the rim of a wide pupil.

    The narrow pupil of 5 mm shows no fold: there the inverse holds to 1e-6 px.
    """
    camera = Camera(optics=Optics(pupil=5.0))
    pixels = places(camera)
    rays = camera.rays(pixels)
    seen = np.isfinite(rays.directions[:, 0])
    assert seen.any()
    found = camera.project(rays.origins + 16.3 * rays.directions)
    np.testing.assert_allclose(found[seen], pixels[seen], rtol=0.0, atol=1e-6)


@pytest.mark.parametrize("name", EYES)
def test_rays_change_from_pixel_to_pixel_as_their_derivatives_say(name):
    """Differences over 2 px of a 5000 px frame, whose own error is 1e-6 of the derivative; seen 14 mm further on."""
    camera = Camera(optics=EYES[name])
    pixels = places(camera)
    rays = camera.rays(pixels)

    def at(pixels):
        there = camera.rays(pixels)
        return there.origins + 14.0 * there.directions

    for axis, by in ((0, "x"), (1, "y")):
        step = np.eye(2)[axis]
        expected = at(pixels + step) - at(pixels - step)
        change = 2.0 * (getattr(rays, f"origins_by_{by}") + 14.0 * getattr(rays, f"directions_by_{by}"))
        both = np.isfinite(expected[:, 0])
        assert both.any()
        np.testing.assert_allclose(change[both], expected[both], rtol=0.0, atol=1e-5 * np.abs(expected[both]).max())


def test_the_pupil_is_where_rays_end_and_outlines_go_on():
    """An outline goes on behind the iris; what no ray meets, and what lies above the lens, is NaN."""
    scene = scene_of(optics={"eye": "navarro", "contact": "flat"})
    near, hidden = scene.camera.project([[4.5, 0.0, 0.9], [6.0, 0.0, 1.6]])
    assert scene.camera.shows(near)
    assert not scene.camera.shows(hidden)
    assert hidden[0] > near[0] > 200.0
    assert np.isnan(scene.camera.rays(hidden).directions).all()
    assert np.isnan(scene.camera.project([0.0, 0.0, 18.0])).all()  # in the lens
    phakic = scene_of(optics={"eye": "navarro"})
    assert np.isnan(phakic.camera.project([3.0, 0.0, 0.4])).all()


def test_a_flat_contact_lens_shows_the_fundus_at_about_unit_magnification():
    plain, flat = scene_of(), scene_of(optics={"eye": "navarro", "contact": "flat"})
    assert flat.camera.pixel_pitch == pytest.approx(plain.camera.pixel_pitch, rel=0.05)
    # and without the lens on the eye a phakic one magnifies several times
    assert scene_of(optics={"eye": "navarro"}).camera.pixel_pitch < 0.25 * plain.camera.pixel_pitch


def test_the_flat_contact_lens_shows_4_8_mm_of_retina_and_a_bare_phakic_eye_half_a_millimetre():
    for optics, least, most in (({"contact": "flat"}, 4.5, 5.1), ({}, 0.4, 0.8)):
        scene = scene_of(optics={"eye": "navarro", **optics})
        x = np.linspace(0.0, 400.0, 2001)
        rays = scene.camera.rays(np.column_stack([x, np.full_like(x, 200.0)]))
        reach = np.nanmax(np.abs(scene.surface.intersect(scene.eye, rays.origins, rays.directions)[:, 0]))
        assert least < reach < most


def test_a_scene_sees_at_the_wavelength_whose_image_is_as_large_as_that_of_its_light():
    """Infrared light goes a way of its own: the camera's rays are those of 850 nm without being asked."""
    scene = load_scene("paper-code")
    data = scene.model_dump(mode="json") | {"eye": {"radius": "12 mm"}}
    data["camera"] = {"resolution": 400, "optics": {"eye": "navarro", "contact": "flat"}}
    green, infrared = (Scene.model_validate({**data, "illumination": light}) for light in ("line532", "ir850"))
    assert green.effective_wavelength == pytest.approx(532.0, abs=0.01)
    assert 840.0 < infrared.effective_wavelength < 860.0
    pixels = places(green.camera, 20)
    for scene in (green, infrared):
        expected = scene.camera.rays(pixels, scene.effective_wavelength).directions
        np.testing.assert_array_equal(scene.camera.rays(pixels).directions, expected)
    moved = green.camera.project([4.0, 0.0, 0.7]) - infrared.camera.project([4.0, 0.0, 0.7])
    assert 0.05 < abs(moved[0]) < 3.0
    assert Scene.model_validate_json(infrared.model_dump_json()) == infrared


def test_a_white_light_has_the_image_of_a_bluer_wavelength_than_its_mean_and_nobody_knows_quite_which():
    data = {"eye": {"radius": "12 mm"}, "retina": "fundus", "sensor": "cmv12000-mono", "illumination": "led-b3"}
    data["camera"] = {"resolution": 400, "optics": {"eye": "navarro", "contact": "flat"}}
    white = read_scene(Document("test", data))
    point, x = np.array([1.0, 0.0, 0.042]), np.arange(400.0, 1000.0, 5.0)
    seen = seen_light(white.illumination.spectrum, SITES["perifovea"], white.camera.optics, white.sensor.responses)
    places = np.array([white.camera.seeing(wavelength).project(point)[0] for wavelength in x])
    mean, told = seen(x) @ places / seen(x).sum(), white.camera.project(point)[0]
    centroid = white.camera.seeing(seen.mean_wavelength).project(point)[0]
    assert abs(told - mean) < 0.1 * abs(centroid - mean)
    assert 1e-4 < white.image_size_sigma < 3e-4
    green = read_scene(Document("test", {**data, "illumination": "line532"}))
    plain = read_scene(Document("test", {**data, "camera": {"resolution": 400}}))
    assert green.image_size_sigma < 1e-6
    assert plain.image_size_sigma == 0.0


def test_none_in_a_file_means_no_optics():
    assert scene_of(optics="none").camera == Camera(resolution=400)


@pytest.mark.parametrize(
    ("data", "said"),
    [
        ({"camera": {"optics": {"pupil": "-1 mm"}}}, r"camera.optics.pupil: .*greater than 0"),
        ({"camera": {"optics": {"eye": "le-grand"}}}, r"write eye: {radius: 13.4 mm}"),
        ({"camera": {"optics": {"eye": "atchison", "lens": "aphakic"}}}, r"semi_axes: \[1.12879, 1.11993, 1\]"),
        ({"camera": {"optics": {"contact": "flat"}, "height": "24.5 mm"}}, "above the eye's optics"),
        ({"camera": {"optics": {"pupil": "1 mm"}, "tilt": "20 deg"}}, "no ray of it meets the retina.*pupil"),
        ({"camera": {"optics": {"lens": "phacik"}}}, "phakic"),
        ({"camera": {"optics": {"refraction": "-2 D"}}}, "no other refraction"),
    ],
)
def test_what_cannot_be_seen_is_refused_in_a_sentence(data, said):
    with pytest.raises(InputError, match=said) as refused:
        read_scene(Document("test", {"eye": {"radius": "12 mm"}, **data}))
    assert "\n" not in str(refused.value)


def test_an_atchison_eye_has_its_own_ellipsoid():
    data = {
        "eye": {"radius": "10.8 mm"},
        "surface": {"semi_axes": [1.07657, 1.08565, 1.0]},
        "camera": {"optics": {"eye": "atchison", "lens": "aphakic", "contact": "flat", "refraction": "-4 D"}},
    }
    scene = read_scene(Document("test", data))
    np.testing.assert_allclose(
        scene.eye.radius * np.array(scene.surface.semi_axes), scene.camera.optics.model.retina, atol=0.01
    )
