"""Rendered radiance against closed forms written here."""

from __future__ import annotations

import math

import cv2
import numpy as np
import pytest
from scipy.stats import t

from conespot.render import Crop, Exposure, Renderer
from conespot.render.exposure import encode
from conespot.render.reflectance import EXTENT, TEXEL, Reflectance
from conespot.render.retina_mesh import from_arc, to_arc
from conespot.render.rim import rim_pixels
from conespot.scene import Camera, Eye, Pose, Scene
from conespot.scene.beam import CyclesBeam, HardBeam, LinearBeam, TabulatedBeam
from conespot.scene.illumination import LIGHTS, Ambient
from conespot.scene.power import Power
from conespot.scene.retina import FundusSite, PhotoRetina, UniformRetina
from conespot.scene.sensor import Linear, Srgb8
from conespot.scene.spotlights import RIGS, Instrument, Shaft, spotlight_axes
from conespot.scene.surface import Bump, Surface, bump_grid

BEAMS = {
    "hard": HardBeam(),
    "soft": CyclesBeam(blend=1.0),
    "half soft": CyclesBeam(blend=0.4),
    "linear": LinearBeam(),
    "table": TabulatedBeam(angles=(0.0, math.radians(4.0), math.radians(9.0)), intensities=(1.0, 0.9, 0.1)),
}


def scene_of(**changes):
    return Scene(**{"camera": Camera(resolution=400), "retina": UniformRetina(albedo=0.1), **changes})


def radiance_of(scene, pose, pixels, spotlight=0):
    """Lambert's closed form at pixel centres: albedo / pi * I(angle) * cos / d^2, from scene geometry alone."""
    rays = scene.camera.back_project(pixels)
    points = scene.surface.intersect(scene.eye, scene.camera.centre, rays)
    outward = points - scene.eye.centre
    normals = scene.surface.normals(scene.eye, outward / np.linalg.norm(outward, axis=-1, keepdims=True))
    to_point = points - pose.apex
    distance = np.linalg.norm(to_point, axis=-1)
    direction = to_point / distance[..., None]
    axis = spotlight_axes(pose, scene.spotlights)[spotlight]
    cosine = np.maximum(-np.sum(normals * direction, axis=-1), 0.0)
    intensity = Power(value=1.0, convention=scene.power.convention).axial_intensity(scene.beam) * scene.beam.intensity(
        direction @ axis
    )
    return 0.1 / math.pi * intensity * cosine / (distance * 1e-3) ** 2


def pixel_grid(crop):
    x, y = np.meshgrid(crop.column + np.arange(crop.width) + 0.5, crop.row + np.arange(crop.height) + 0.5)
    return np.stack([x, y], axis=-1)


@pytest.mark.parametrize("name", BEAMS)
@pytest.mark.parametrize("convention", ["isotropic", "flux"])
def test_radiance_of_a_tile_is_lamberts_closed_form(name, convention):
    """A rendered tile against albedo / pi * I cos / d^2 at its pixels' centres; the median ratio within 0.1 %."""
    scene = scene_of(beam=BEAMS[name], power=Power(convention=convention))
    pose = scene.pose(np.array([1.2, -0.7, 4.0]))
    tile = Renderer(scene, samples=16).tile(pose, 0, seed=3)
    expected = radiance_of(scene, pose, pixel_grid(tile.crop))
    inside = expected > 0.02 * expected.max()
    # a pixel's mean is not its centre's value where the profile bends; only interior pixels are compared
    inner = cv2.erode(inside.astype(np.uint8), np.ones((5, 5), np.uint8)) > 0
    assert inner.sum() > 200
    ratio = tile.radiance[..., 0][inner] / expected[inner]
    # stratified samples estimate the pixel's mean without bias: so does the median over hundreds of pixels
    assert abs(np.median(ratio) - 1.0) < 1e-3
    assert np.abs(ratio - 1.0).max() < 0.08


@pytest.mark.parametrize("name", BEAMS)
@pytest.mark.parametrize("convention", ["isotropic", "flux"])
def test_flux_through_the_cone_is_the_stated_watts(name, convention):
    """Radiance times pi / albedo, summed over the surface the camera sees, against the stated watts; within 0.1 %."""
    scene = scene_of(beam=BEAMS[name], power=Power(convention=convention))
    pose = scene.pose(np.array([0.5, 0.5, 5.0]))
    tile = Renderer(scene, samples=64).tile(pose, 0, seed=4)
    # area of the surface behind a pixel [mm2]: solid angle times distance squared over the cosine
    pixels = pixel_grid(tile.crop)
    rays = scene.camera.back_project(pixels)
    distance = scene.eye.intersect(scene.camera.centre, rays)
    normals = (scene.eye.centre - (scene.camera.centre + distance[..., None] * rays)) / scene.eye.radius
    solid_angle = (-rays[..., 2]) ** 3 / scene.camera.focal_length_px**2
    area = solid_angle * distance**2 / -np.sum(rays * normals, axis=-1) * 1e-6
    seen = float(np.sum(tile.radiance[..., 0] * math.pi / 0.1 * area))
    assert seen == pytest.approx(Power(value=1.0, convention=convention).flux(scene.beam), rel=1e-3)


def test_background_is_albedo_over_pi_times_irradiance():
    """The rendered background at three pixels against albedo / pi * E cos of a tilted light; within 0.1 %."""
    scene = scene_of(ambient=Ambient(irradiance=2.0, tilt=math.radians(10.0), azimuth=0.4))
    background = Renderer(scene).background()[..., 0]
    pixels = np.array([[20.5, 30.5], [200.5, 200.5], [380.5, 100.5]])
    rays = scene.camera.back_project(pixels)
    points = scene.camera.centre + scene.eye.intersect(scene.camera.centre, rays)[:, None] * rays
    normals = (scene.eye.centre - points) / scene.eye.radius
    light = np.array(
        [math.sin(0.174532925) * math.cos(0.4), math.sin(0.174532925) * math.sin(0.4), math.cos(0.174532925)]
    )
    seen = background[pixels[:, 1].astype(int), pixels[:, 0].astype(int)]
    np.testing.assert_allclose(seen, 0.1 / math.pi * 2.0 * normals @ light, rtol=1e-3)


@pytest.mark.parametrize("where", [(0.0, 0.0), (4.5, 3.0), (-5.5, 5.0), (2.0, -5.8)])
def test_a_known_point_projects_to_the_same_pixel_in_scene_and_mitsuba(where):
    """A small bright disc of albedo is rendered; its centroid must be where `Camera.project` puts its centre."""
    scene = Scene(camera=Camera(resolution=1000), beam=HardBeam(half_angle=math.radians(1.0)), retina=UniformRetina())
    # a thin cone straight down the normal at the point lights a disc around it
    point = scene.surface.points(scene.eye, from_arc(scene, np.array(where)))
    inward = (scene.eye.centre - point) / scene.eye.radius
    pose = Pose(point + 4.0 * inward, -inward)
    tile = Renderer(scene, samples=256).tile(pose, 0, seed=1)
    weights = tile.radiance[..., 0].astype(float)
    centroid = np.tensordot(weights, pixel_grid(tile.crop), axes=([0, 1], [0, 1])) / weights.sum()
    # the disc's own perspective moves its centroid: compared with that of its outline, exactly projected
    outline = scene.camera.project(scene.outline(pose, 0, points=720))
    x, y = outline.T
    cross = x * np.roll(y, -1) - np.roll(x, -1) * y
    expected = [((c + np.roll(c, -1)) * cross).sum() / (3.0 * cross.sum()) for c in (x, y)]
    assert np.abs(centroid - expected).max() < 0.05
    assert np.abs(scene.camera.project(point) - expected).max() < 0.05


def test_texture_lies_where_the_arc_coordinates_say():
    """The background over the ambient light's closed form is the albedo map, looked up through `scene` alone."""
    scene = scene_of(camera=Camera(resolution=1000), retina=PhotoRetina())
    background = Renderer(scene).background()[..., 0]
    pixels = pixel_grid(Crop(0, 0, 1000, 1000))
    rays = scene.camera.back_project(pixels)
    points = scene.camera.centre + scene.eye.intersect(scene.camera.centre, rays)[..., None] * rays
    cosine = ((scene.eye.centre - points) / scene.eye.radius)[..., 2]
    arc = to_arc(scene, points)
    albedo = cv2.boxFilter(Reflectance(scene.retina).map, -1, (3, 3))
    column, row = ((arc[..., k] * sign + EXTENT) / TEXEL - 0.5 for k, sign in ((0, 1.0), (1, -1.0)))
    near = cv2.remap(albedo, column.astype(np.float32), row.astype(np.float32), cv2.INTER_LINEAR)
    seen = background / (scene.ambient.irradiance / math.pi * cosine)
    assert np.ptp(near) > 0.05, "the texture must have a pattern for this to mean anything"
    assert np.percentile(np.abs(seen / near - 1.0), 99) < 0.05
    assert abs(np.mean(seen / near) - 1.0) < 2e-3


def test_bumps_are_displaced_and_shaded_as_the_closed_form_says():
    """A tile over a bump against Lambert's law on the surface's own points and normals; the median within 0.2 %."""
    scene = scene_of(surface=Surface(bumps=(Bump(x=0.3, y=0.2, diameter=1.0, height=0.1),)), beam=HardBeam())
    pose = scene.pose(np.array([1.0, 0.0, 5.0]))
    tile = Renderer(scene, samples=64).tile(pose, 0, seed=5)
    pixels = pixel_grid(tile.crop)
    expected = radiance_of(scene, pose, pixels)
    flat = radiance_of(scene_of(beam=HardBeam()), pose, pixels)
    bumped = (np.abs(expected / np.where(flat > 0, flat, np.inf) - 1.0) > 0.05) & (expected > 0)
    assert bumped.sum() > 100, "the bump must show for this test to mean anything"
    inner = expected > 0.5 * flat.max()
    ratio = tile.radiance[..., 0][inner] / expected[inner]
    assert abs(np.median(ratio) - 1.0) < 2e-3
    assert np.percentile(np.abs(ratio - 1.0), 90) < 0.03


def test_sum_of_tiles_times_power_is_one_render_at_that_power():
    """z-test per pixel, Sidak-corrected: the tiled frame against brute force with all lights in one scene of a mesh."""
    import mitsuba as mi

    from conespot.render import emitters
    from conespot.render.retina_mesh import retina_mesh

    scene = scene_of(spotlights=RIGS["triple"], retina=PhotoRetina(), camera=Camera(resolution=300))
    pose = scene.pose(np.array([0.8, 0.4, 4.0]))
    power = 0.25
    renderer = Renderer(scene, samples=16)
    runs = 16
    tiled = np.empty((runs, 300, 300))
    for i in range(runs):
        frame = np.zeros((300, 300), np.float32)
        for k in range(3):
            tile = renderer.tile(pose, k, seed=100 * i + k)
            frame[tile.crop.slices] += power * tile.radiance[..., 0]
        tiled[i] = frame
    # brute force: the same retina under three lights of that power in one Mitsuba scene, whole frame
    lights = {}
    for k, axis in enumerate(spotlight_axes(pose, scene.spotlights)):
        light = emitters.spotlight(mi, scene)
        light["to_world"] = emitters.aim(mi, pose.apex, axis)
        intensity = power / (4.0 * math.pi) * 1e6 / 300.0
        light["intensity"] = {
            "type": "regular",
            "wavelength_min": 400.0,
            "wavelength_max": 700.0,
            "values": f"{intensity}, {intensity}",
        }
        lights[f"light{k}"] = light
    look = Reflectance(scene.retina)
    brute_scene = mi.load_dict(
        {
            "type": "scene",
            "integrator": {"type": "path", "max_depth": 2},
            "retina": retina_mesh(mi, scene, mi.load_dict(look.bsdf(mi, look.texture(mi, None)))),
            "sensor": {
                "type": "perspective",
                "fov": math.degrees(scene.camera.full_fov),
                "fov_axis": "x",
                "to_world": mi.ScalarTransform4f().look_at(origin=[0, 0, 110], target=[0, 0, 0], up=[0, 1, 0]),
                "film": {
                    "type": "specfilm",
                    "width": 300,
                    "height": 300,
                    "component_format": "float32",
                    "rfilter": {"type": "box"},
                    "band": {"type": "regular", "wavelength_min": 400.0, "wavelength_max": 700.0, "values": "1, 1"},
                },
            },
            **lights,
        }
    )
    brute = np.stack([np.array(mi.render(brute_scene, spp=48, seed=1000 + i))[..., 0] for i in range(runs)])
    spread = np.sqrt(tiled.var(axis=0, ddof=1) / runs + brute.var(axis=0, ddof=1) / runs)
    lit = spread > 1e-6 * brute.mean()
    z = (tiled.mean(axis=0) - brute.mean(axis=0))[lit] / spread[lit]
    assert lit.sum() > 2000
    # t distribution with about 2 (runs - 1) degrees, Sidak-corrected for all pixels at 1 % false alarm
    limit = t.isf((1.0 - 0.99 ** (1.0 / lit.sum())) / 2.0, runs - 1)
    assert np.abs(z).max() < limit
    totals = tiled.sum(axis=(1, 2)), brute.sum(axis=(1, 2))
    error = math.sqrt(sum(total.var(ddof=1) / runs for total in totals))
    assert abs(totals[0].mean() - totals[1].mean()) < 4.0 * error
    assert error < 2e-3 * totals[1].mean(), "the totals must be known well for this to mean anything"


def test_exposing_at_more_powers_renders_nothing_more():
    """The count of renderings at one power against that at four."""
    scene = scene_of()
    renderer = Renderer(scene, samples=4)
    exposure = Exposure(renderer.background(), scene.sensor)
    tiles = [renderer.tile(scene.pose(np.array([0.0, 0.0, 4.0])), 0, seed=1)]
    before = renderer.rendered
    frames = [exposure.frame(tiles, power) for power in (0.001, 0.01, 0.1, 1.0)]
    assert renderer.rendered == before == 2
    sums = [int(f.sum(dtype=np.int64)) for f in frames]
    assert sums == sorted(sums)
    assert sums[0] < sums[-1]


@pytest.mark.parametrize("power", [2.0**-5, 0.25, 2.0])
def test_a_frame_is_exactly_linear_in_power(power):
    """Linear pixel values over darkness against those of the 1 W frame times the power: equal to half a step."""
    scene = scene_of(sensor=Linear(white=500.0, bits=16), ambient=Ambient(irradiance=0.0))
    renderer = Renderer(scene, samples=4)
    tile = renderer.tile(scene.pose(np.array([0.0, 1.0, 4.0])), 0, seed=1)
    exposure = Exposure(renderer.background(), scene.sensor)
    exact = tile.radiance[..., 0].astype(float) * power / 500.0 * 65535.0
    assert exact.max() < 65535.0
    assert np.abs(exposure.frame([tile], power)[tile.crop.slices] - exact).max() <= 0.5 + 1e-2


def test_a_frame_is_the_encoded_background_plus_scaled_tiles():
    """`Exposure.frame`, which works on crops, against the whole frame composed here; to one step of rounding."""
    scene = scene_of(spotlights=RIGS["triple"], sensor=Linear(white=20.0, bits=12))
    renderer = Renderer(scene, samples=4)
    pose = scene.pose(np.array([0.0, 1.0, 4.0]))
    tiles = [renderer.tile(pose, k, seed=k) for k in range(3)]
    total = renderer.background().astype(np.float32).copy()
    for tile in tiles:
        total[tile.crop.slices] += np.float32(0.3) * tile.radiance
    frame = Exposure(renderer.background(), scene.sensor).frame(tiles, 0.3)
    assert frame.dtype == np.uint16
    assert np.abs(frame.astype(int) - encode(total[..., 0], scene.sensor).astype(int)).max() <= 1


def test_the_same_seed_gives_the_same_tile_in_any_order():
    """Tiles of three poses against the same rendered backwards by another renderer: equal to the bit."""
    scene = scene_of(retina=PhotoRetina())
    poses = [scene.pose(np.array([x, 0.3, 4.0])) for x in (-1.0, 0.0, 1.0)]
    first, second = Renderer(scene), Renderer(scene)
    forward = [first.tile(p, 0, seed=9).radiance for p in poses]
    backward = [second.tile(p, 0, seed=9).radiance for p in reversed(poses)][::-1]
    for a, b in zip(forward, backward, strict=True):
        np.testing.assert_array_equal(a, b)
    assert not np.array_equal(forward[0], first.tile(poses[0], 0, seed=10).radiance)


def test_the_shaft_hides_the_retina_and_casts_a_shadow():
    """A background with a black shaft against one without, where the shaft and its cast shadow project."""
    ambient = Ambient(tilt=math.radians(20.0), azimuth=math.pi / 2)
    scene = scene_of(ambient=ambient, instrument=Instrument(shaft=Shaft(albedo=0.0)))
    pose = scene.pose(np.array([0.0, 0.0, 4.0]))
    renderer = Renderer(scene)
    bare, shaded = renderer.background(), renderer.background(pose)
    dark = shaded[..., 0] < 0.3 * bare[..., 0]
    on_shaft = scene.camera.project(pose.apex - 3.0 * pose.axis)
    assert dark[int(on_shaft[1]), int(on_shaft[0])]
    # the shadow falls where the light's ray through a point of the shaft meets the retina, away from the lamp
    middle = pose.apex - 3.0 * pose.axis
    down = -np.array([0.0, math.sin(ambient.tilt), math.cos(ambient.tilt)])
    shadow = scene.camera.project(middle + scene.eye.intersect(middle, down) * down)
    assert dark[int(shadow[1]), int(shadow[0])]
    assert np.linalg.norm(shadow - on_shaft) > 20.0
    assert 0.005 < dark.mean() < 0.2
    # the spot's own light is behind no shaft: the patch is as bright as without
    plain = Renderer(scene_of(ambient=ambient)).tile(pose, 0, seed=2)
    with_shaft = renderer.tile(pose, 0, seed=2)
    # without a shaft the retina is Mitsuba's sphere and not a mesh: the same to the last bits of float32
    assert with_shaft.radiance.sum() <= plain.radiance.sum() * (1.0 + 1e-6)
    assert with_shaft.radiance.sum() > 0.3 * plain.radiance.sum()


def test_a_patch_outside_the_field_is_an_empty_tile():
    scene = scene_of(instrument=Instrument(rcm=(-11.0, 0.0, 14.0)))
    tile = Renderer(scene).tile(scene.pose(np.array([9.0, 0.0, 9.0])), 0, seed=1)
    assert tile.radiance.size == 0
    frame = Exposure(np.zeros((400, 400, 1), np.float32), scene.sensor).frame([tile], 1.0)
    assert not frame.any()


def test_srgb8_encodes_as_iec_61966_2_1():
    radiance = np.array([0.0, 0.001, 0.0031308, 0.05, 0.214, 1.0, 7.0], np.float32)
    plain = [0.0, 0.01292, 0.04045, 0.247801, 0.499946, 1.0, 1.0]
    np.testing.assert_array_equal(encode(radiance, Srgb8(white=1.0)), np.floor(np.array(plain) * 255 + 0.5))


def test_arc_coordinates_invert_and_keep_distances_from_the_pole():
    scene = Scene(eye=Eye(radius=12.5))
    arc = np.random.default_rng(0).uniform(-7, 7, (100, 2))
    directions = from_arc(scene, arc)
    points = scene.surface.points(scene.eye, directions)
    np.testing.assert_allclose(to_arc(scene, points), arc, atol=1e-12)
    np.testing.assert_allclose(12.5 * np.arccos(-directions[:, 2]), np.linalg.norm(arc, axis=1), atol=1e-9)


def test_bump_grid_is_the_papers_fifteen_bumps():
    assert len(bump_grid().bumps) == 15
    assert {(b.diameter, b.height) for b in bump_grid().bumps} == {(0.5, 0.1)}


@pytest.mark.parametrize("bumps", [False, True])
def test_a_refined_edge_is_unbiased_and_leaves_no_noisy_pixel(bumps):
    """Tiles with 256 samples on the edge; against plain ones of 256 everywhere; z-test per pixel, Sidak-corrected.

    The scatter of each pixel over the runs must nowhere be above what 256 samples leave in the worst one.
    """
    surface = Surface(bumps=(Bump(x=1.9, y=-0.5, diameter=1.0, height=0.1),)) if bumps else Surface()
    scene = scene_of(beam=HardBeam(), surface=surface)
    pose = scene.pose(np.array([1.2, -0.7, 4.0]))
    runs = 16
    refined, plain, coarse = (
        np.stack([renderer.tile(pose, 0, seed=first + i).radiance[..., 0].astype(float) for i in range(runs)])
        for first, renderer in (
            (100, Renderer(scene, samples=16, edge_samples=256)),
            (200, Renderer(scene, samples=256)),
            (300, Renderer(scene, samples=16)),
        )
    )
    lit = (refined.var(axis=0) > 0.0) & (plain.var(axis=0) > 0.0)
    z = (refined.mean(axis=0) - plain.mean(axis=0))[lit]
    z /= np.sqrt((refined.var(axis=0, ddof=1) + plain.var(axis=0, ddof=1))[lit] / runs)
    limit = t.isf((1.0 - 0.99 ** (1.0 / lit.sum())) / 2.0, runs - 1)
    assert lit.sum() > 1000
    assert np.abs(z).max() < limit
    step = np.median(plain[plain > 0.0])
    worst = [image.std(axis=0, ddof=1).max() / step for image in (refined, plain, coarse)]
    assert worst[0] < 1.25 * worst[1]
    assert worst[0] < worst[2] / 4.0


def test_a_beam_is_refined_where_it_is_steep_and_nowhere_else():
    """Pixels of the refined edge by the angle that their centres are seen at from the tip."""
    pose = scene_of().pose(np.array([0.5, 0.5, 5.0]))
    step = TabulatedBeam(angles=tuple(math.radians(a) for a in (0.0, 5.0, 5.01, 9.0)), intensities=(1.0, 0.9, 0.4, 0.0))
    angles = {}
    per_pixel = 18.0 / np.ptp(scene_of().camera.project(scene_of().outline(pose, 0)), axis=0).min()
    for name, beam in {**BEAMS, "step inside": step}.items():
        scene = scene_of(beam=beam)
        row, column = np.divmod(rim_pixels(scene, pose, 0).astype(int), 400)
        rays = scene.camera.back_project(np.stack([column, row], axis=-1) + 0.5)
        to_point = scene.surface.intersect(scene.eye, scene.camera.centre, rays) - pose.apex
        angles[name] = np.degrees(np.arccos(to_point @ pose.axis / np.linalg.norm(to_point, axis=-1)))
    assert not angles["soft"].size
    for name, at in {"hard": 9.0, "step inside": 5.0}.items():
        # a pixel's corner is up to 0.7 px from its centre, and the edge is followed within half a pixel
        assert np.abs(angles[name] - at).max() < 1.2 * per_pixel
        assert np.histogram(angles[name], bins=3, range=(at - 0.15, at + 0.15))[0].min() > 20


def test_a_pixel_is_the_same_whatever_else_is_rendered_and_in_however_many_passes(monkeypatch):
    """A crop against one pixel in three of it, and against passes of 1,000 samples: equal to the bit."""
    from conespot.render import kernel, stage

    assert kernel.load()[2].vectorized
    renderer = Renderer(scene_of(retina=PhotoRetina()), samples=16)
    lit = renderer.tile(renderer.scene.pose(np.array([1.2, -0.7, 4.0])), 0, seed=3).crop
    crop = Crop(lit.row + 3, lit.column + 5, lit.height - 10, lit.width // 2)
    whole = renderer._lit.render(crop, 16, seed=3)
    assert whole.max() > 0.0
    some = renderer._lit.pixels(crop.pixels(400)[::3], 16, seed=3)
    np.testing.assert_array_equal(some, whole.reshape(-1, 1)[::3])
    monkeypatch.setattr(stage, "PASS", 1000)
    np.testing.assert_array_equal(renderer._lit.render(crop, 16, seed=3), whole)
    assert not np.array_equal(renderer._lit.render(crop, 16, seed=4), whole)


@pytest.mark.parametrize("samples", [1, 7, 12, 64])
def test_any_number_of_samples_is_unbiased(samples):
    """Mean of the lit radiance over many seeds with few or a prime number of samples; against 1,024; four sigma."""
    scene = scene_of(beam=HardBeam())
    pose = scene.pose(np.array([1.2, -0.7, 4.0]))
    renderer = Renderer(scene, samples=samples)
    totals = [renderer.tile(pose, 0, seed=i).radiance.sum(dtype=float) for i in range(24)]
    expected = Renderer(scene, samples=1024).tile(pose, 0, seed=99).radiance.sum(dtype=float)
    error = np.std(totals, ddof=1) / math.sqrt(24)
    assert error < 1e-3 * expected
    assert abs(np.mean(totals) - expected) < 4.0 * error


def test_rectangles_cover_any_pixels_once():
    """The scalar variant's rectangles of a random mask: their pixels, put together, are those of the mask."""
    mask = np.random.default_rng(3).random((40, 40)) < 0.6
    mask[5:20, 3:30] = True
    pixels = np.flatnonzero(mask).astype(np.uint32)
    crops = list(Crop.covering(pixels, 40))
    assert len(crops) < mask.sum() / 1.5
    np.testing.assert_array_equal(np.sort(np.concatenate([c.pixels(40) for c in crops])), pixels)
    assert list(Crop.covering(Crop(2, 7, 5, 6).pixels(40), 40)) == [Crop(2, 7, 5, 6)]


def test_white_light_over_a_uniform_spectral_retina_leaves_little_noise():
    """Scatter over seeds of a pixel inside the patch, 16 samples; 64 wavelengths, each in a cell of its own."""
    scene = scene_of(retina=FundusSite(), illumination=LIGHTS["led-b3"], beam=HardBeam())
    pose = scene.pose(np.array([1.2, -0.7, 4.0]))
    renderer = Renderer(scene, samples=16)
    tiles = np.stack([renderer.tile(pose, 0, seed=i).radiance[..., 0].astype(float) for i in range(12)])
    inner = cv2.erode((tiles.min(axis=0) > 0.0).astype(np.uint8), np.ones((5, 5), np.uint8)) > 0
    scatter = tiles.std(axis=0, ddof=1)[inner] / tiles.mean(axis=0)[inner]
    assert inner.sum() > 300
    # were the cells of a ray's four wavelengths the same, it would be 1.3 %
    assert np.sqrt(np.mean(scatter**2)) < 5e-3
