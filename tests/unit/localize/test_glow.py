"""Light that comes back from under the retina: the model's map against a sum over the patch, and fits that see through.

Frames are made here, pixel by pixel and by a convolution finer than any that the fits do, of the table's kernel.
"""

import math

import numpy as np
import pytest
import scipy.fft
from scipy.ndimage import map_coordinates

from conespot.localize import Knowns, SensorNoise, locate
from conespot.localize.calibration import NAMES, calibrate
from conespot.localize.deep_light import SharedDeep, shared_deep
from conespot.localize.halo import glows
from conespot.localize.image import Frame, Reference
from conespot.localize.model.deep import Deep
from conespot.localize.model.estimate import Estimate
from conespot.localize.model.forward import light, moved
from conespot.localize.model.glow import Glow
from conespot.localize.model.knowns import DEEP_SIGMA
from conespot.localize.model.sight import Sight
from conespot.localize.theory.bounds import cramer_rao
from conespot.scene import Scene
from conespot.scene.beam import CyclesBeam, HardBeam
from conespot.scene.camera import Camera
from conespot.scene.illumination import FlatBand
from conespot.scene.retina import Fundus, Spread
from conespot.scene.sensor import Linear
from conespot.scene.spread import WIDTHS, spread_kernel

PEAK, AMBIENT, READ = 9000.0, 200.0, 15.0
NOISE = SensorNoise(levels=4095, electrons=1.25 * PEAK, read=READ)
INFRARED = FlatBand(name="infrared", low=845.0, high=855.0)
CELL = 0.01  # of the frames' convolution [mm]
SIDE = 1e-3  # of the bins that look at single places [mm]


def scene_of(beam=None, *, resolution=1000, spread=None):
    return Scene(
        beam=beam or HardBeam(),
        camera=Camera(resolution=resolution),
        illumination=INFRARED,
        retina=Fundus(spread=spread or Spread()),
        sensor=Linear(bits=12),
    )


def irradiance(scene, pose, points):
    """On the eye's sphere at points `[..., 3]`, for unit on-axis intensity."""
    to = points - pose.apex
    distance = np.linalg.norm(to, axis=-1)
    facing = np.sum((points - scene.eye.centre) * to, axis=-1) / (scene.eye.radius * distance)
    return scene.beam.intensity(np.clip(to @ pose.axis / distance, -1.0, 1.0)) * np.maximum(facing, 0.0) / distance**2


def seen(scene, x, y):
    rays = scene.camera.rays(np.stack(np.meshgrid(x, y), axis=-1).reshape(-1, 2))
    return rays.origins + scene.eye.intersect(rays.origins, rays.directions)[:, None] * rays.directions


def frame(scene, pose, seed, fine=4):
    """A frame of an even retina `[H, W]` uint16, the spotlight's local and deep light in the closed form's shares."""
    side, outline = scene.camera.resolution, scene.outline(pose, 0, 64)
    low, high = np.clip(np.array([f(scene.camera.project(outline), axis=0) for f in (np.min, np.max)]), 0, side)
    low, high = np.floor(low).astype(int) - 2, np.ceil(high).astype(int) + 2
    x, y = (low[k] + (np.arange((high - low)[k] * fine) + 0.5) / fine for k in (0, 1))
    near = irradiance(scene, pose, seen(scene, x, y)).reshape(len(y) // fine, fine, len(x) // fine, fine).mean((1, 3))
    local = np.zeros((side, side))
    local[low[1] : high[1], low[0] : high[0]] = near
    # the tangents of a flat map about the patch; areas and distances from its middle are true
    eye, middle = scene.eye, outline.mean(axis=0) - scene.eye.centre
    frame = np.linalg.svd(middle[None])[2]
    frame[0] *= np.sign(frame[0] @ middle)
    half = 3.0
    n = int(2.0 * half / CELL)
    u, v = np.meshgrid(*[(np.arange(n) + 0.5) * CELL - half] * 2)
    square = (u**2 + v**2) / eye.radius**2
    flat = np.sqrt(1.0 - square / 4.0) / eye.radius
    map_of = np.stack([1.0 - square / 2.0, u * flat, v * flat], axis=-1) @ frame
    spectrum = scipy.fft.rfft2(irradiance(scene, pose, eye.centre + eye.radius * map_of))
    kernel = spread_kernel(850.0, "medium")
    rings = np.square(np.fft.fftfreq(n, CELL))[:, None] + np.square(np.fft.rfftfreq(n, CELL))
    blur = sum(a * np.exp(-2.0 * np.pi**2 * w**2 * rings) for a, w in zip(kernel.parts, WIDTHS, strict=True))
    spread = scipy.fft.irfft2(spectrum * blur, s=(n, n))
    away = (seen(scene, np.arange(side) + 0.5, np.arange(side) + 0.5) - eye.centre) / eye.radius @ frame.T
    scale = eye.radius * np.sqrt(2.0 / (1.0 + away[:, 0]))
    at = [(scale * away[:, k] + half) / CELL - 0.5 for k in (2, 1)]
    deep = map_coordinates(spread, at, order=1).reshape(side, side)
    share = float(Deep.of(scene_of()).shares[0])
    light = (1.0 - share) * local + share * deep
    rng = np.random.default_rng(seed)
    peak = np.quantile(light[light > 0.5 * light.max()], 0.99)
    electrons = rng.poisson(AMBIENT + (PEAK - AMBIENT) * light / peak) + READ * rng.standard_normal(light.shape)
    return np.clip(np.round(electrons / (1.25 * PEAK) * 4095.0), 0, 4095).astype(np.uint16)


def bins_at(places, scene):
    """Bins of `SIDE` mm that look straight at places of the eye's sphere."""
    normals = _unit(scene.eye.centre - places)
    first = _unit(np.cross(normals, np.array([0.3, 0.9, 0.1])))
    return Sight(places, normals, SIDE * first, SIDE * np.cross(normals, first))


def sharp(sight, estimate):
    return light(sight, estimate.pose, estimate.scene, estimate.profile)


def glow_at(places, estimate, near=None):
    sight = bins_at(places, estimate.scene)
    return Glow(near or estimate, sight, SIDE).light(estimate, (), sharp(sight, estimate))[0]


def test_deep_light_is_the_sum_over_the_patch_of_the_kernel_at_true_distances():
    scene = scene_of()
    pose = scene.pose(np.array([1.5, -1.0, 4.0]))
    rim = scene.outline(pose, 0, 6)
    middle = rim.mean(axis=0)
    places = np.concatenate([middle + factor * (rim - middle) for factor in (0.0, 0.5, 0.9, 1.1, 1.5, 2.0)])
    places = scene.eye.centre + scene.eye.radius * _unit(places - scene.eye.centre)
    found = glow_at(places, Estimate(pose, scene))
    axis = _unit(middle - scene.eye.centre)
    cosine = np.cos(0.07 * np.sqrt((np.arange(40_000) + 0.5) / 40_000))  # an even lattice of the cap about the patch
    turn = np.arange(40_000) * math.pi * (3.0 - math.sqrt(5.0))
    first, second = np.linalg.svd(axis[None])[2][1:]
    around = np.cos(turn)[:, None] * first + np.sin(turn)[:, None] * second
    source = scene.eye.centre + scene.eye.radius * (cosine[:, None] * axis + np.sqrt(1.0 - cosine**2)[:, None] * around)
    area = 2.0 * math.pi * scene.eye.radius**2 * (1.0 - cosine[-1]) / len(source)
    lit = irradiance(scene, pose, source)
    kernel = Deep.of(scene).kernels[0]
    summed = [area * lit @ kernel(np.linalg.norm(source - place, axis=1)) for place in places]
    assert found.value == pytest.approx(np.array(summed), rel=0.03, abs=0.005 * lit.max())


def _unit(vector):
    return vector / np.linalg.norm(vector, axis=-1, keepdims=True)


def test_next_to_a_hard_rim_deep_light_falls_as_the_kernel_says_and_not_by_cells():
    """The mean irradiance where light comes from, by quantiles of the kernel's distances in all directions."""
    scene = scene_of()
    pose = scene.pose(np.array([0.5, -1.0, 4.0]))
    rim = scene.outline(pose, 0, 2)
    outwards = _unit(rim - rim.mean(axis=0))
    offsets = np.array([-0.1, -0.03, -0.01, -0.003, 0.003, 0.01, 0.03, 0.1])
    eye, kernel = scene.eye, Deep.of(scene).kernels[0]
    up = _unit((rim + offsets[:, None, None] * outwards).reshape(-1, 3) - eye.centre)
    radii = np.geomspace(1e-4, 10.0, 4000)
    chord = np.interp((np.arange(1200) + 0.5) / 1200, kernel.enclosed(radii), radii)
    turn = np.arange(180)[:, None] * (2.0 * math.pi / 180)
    summed = []
    for at in up:
        first, second = np.linalg.svd(at[None])[2][1:]
        sideways = (np.cos(turn) * first + np.sin(turn) * second)[:, None]
        away = (1.0 - chord**2 / (2.0 * eye.radius**2))[:, None] * at
        away = away + (chord / eye.radius * np.sqrt(1.0 - np.square(chord / eye.radius) / 4.0))[:, None] * sideways
        summed.append(irradiance(scene, pose, eye.centre + eye.radius * away).mean())
    found = glow_at(eye.centre + eye.radius * up, Estimate(pose, scene))
    assert found.value == pytest.approx(np.array(summed), abs=0.003 * max(summed))


def test_derivatives_of_deep_light_are_those_of_its_value():
    scene = scene_of(CyclesBeam())
    pose = scene.pose(np.array([0.5, 1.0, 4.0]))
    rim = scene.outline(pose, 0, 24)
    here = Estimate(pose, scene)
    found = glow_at(rim, here)

    def at(estimate):
        return glow_at(rim, estimate, near=here).value

    for k, row in enumerate(found.jacobian):
        step = np.eye(5)[k] * 1e-3
        sides = (at(Estimate(moved(pose, sign * step), scene)) for sign in (1.0, -1.0))
        assert (next(sides) - next(sides)) / 2e-3 == pytest.approx(row, abs=0.02 * np.abs(row).max())
    longer, shorter = (at(Estimate(pose, scene_of(CyclesBeam(), spread=Spread(length=f)))) for f in (1.02, 1.0 / 1.02))
    slope = (longer - shorter) / (2.0 * math.log(1.02))
    assert slope == pytest.approx(found.by_length, abs=0.01 * np.abs(found.by_length).max())


def test_near_its_last_place_deep_light_goes_on_in_proportion():
    scene = scene_of()
    pose = scene.pose(np.array([0.0, 1.0, 4.0]))
    rim = scene.outline(pose, 0, 24)
    here, there = Estimate(pose, scene), Estimate(moved(pose, np.array([0.002, -0.002, 0.002, 3e-4, -3e-4])), scene)
    sight = bins_at(rim, scene)
    glow = Glow(here, sight, SIDE)
    glow.light(here, (), sharp(sight, here))
    whole = glow_at(rim, there, near=here).value
    assert glow.light(there, (), sharp(sight, there))[0].value == pytest.approx(whole, rel=0.01)
    free = Knowns(half_angle_sigma_deg=None).free
    wider = light(sight, pose, scene, here.profile, changes=here.beam_changes(free))
    assert len(glow.light(here, free, wider)[0].jacobian) == 6
    assert len(glow.light(there, (), sharp(sight, there))[0].jacobian) == 5


@pytest.mark.parametrize(
    "beam", [pytest.param(HardBeam(), id="hard", marks=pytest.mark.slow), pytest.param(CyclesBeam(), id="soft")]
)
def test_a_core_on_a_glow_told_within_a_factor_of_two_is_found_by_its_core(beam):
    """And without a word of it too, since the patch glows beyond its rim: taken for a patch without, the soft one is
    100 um off, and the hard one refused."""
    scene = scene_of(beam)
    pose = scene.pose(np.array([1.5, -1.0, 4.0]))
    image = frame(scene, pose, 1)
    told = scene_of(beam, spread=Spread(amount=0.6, length=1.6))
    untold = scene.model_copy(update={"retina": Fundus()})
    for scene_told in (told, untold):
        found = locate(image, scene_told, "photometric", knowns=Knowns(0.01), noise=NOISE)
        off = found.apex_mm - pose.apex
        assert float(np.linalg.norm(off)) < 0.006
        assert off @ np.linalg.solve(found.covariance[:3, :3], off) < 16.0
    held = locate(image, untold, "photometric", knowns=Knowns(0.01, deep_amount_sigma=0.0), noise=NOISE)
    assert not held or float(np.linalg.norm(held.apex_mm - pose.apex)) > 0.01


@pytest.mark.parametrize("beam", [HardBeam(), CyclesBeam()], ids=["hard", "soft"])
def test_a_patch_beside_a_bright_disc_does_not_glow(beam):
    scene = scene_of(beam, resolution=300).model_copy(update={"retina": Fundus()})
    pose = scene.pose(np.array([0.5, -1.0, 4.0]))
    x = np.arange(300) + 0.5
    points = seen(scene, x, x)
    light = irradiance(scene, pose, points)
    disc = np.linalg.norm(points - scene.outline(pose, 0, 12)[0], axis=1) < 0.8
    signal = (200.0 + 8800.0 * light / light.max()) * np.where(disc, 2.0, 1.0) / 20000.0
    image = np.random.default_rng(1).poisson(4095 * signal).astype(np.uint16).reshape(300, 300)
    black = Reference(np.zeros((300, 300), np.float32))  # says nothing
    for reference in (None, black):
        assert not glows(Frame(image, scene.sensor), Estimate(pose, scene), reference)


@pytest.mark.slow
def test_frames_that_glow_calibrate_a_softness():
    """Three frames, told of the glow within a factor of two and of the softness a tenth off."""
    scene = scene_of(CyclesBeam(blend=0.9), resolution=500)
    told = scene_of(CyclesBeam(blend=1.0), resolution=500, spread=Spread(amount=0.7, length=1.4))
    tips = ((1.0, 0.0, 4.0), (-1.0, 1.5, 3.5), (0.0, -1.5, 5.0))
    frames = [frame(scene, scene.pose(np.array(tip)), k) for k, tip in enumerate(tips)]
    found = calibrate(lambda: frames, told, noise=NOISE)
    at = NAMES.index("softness")
    assert found.observable["softness"]
    assert found.values[at] == pytest.approx(0.9, abs=4.0 * found.sigmas[at])


@pytest.mark.parametrize("beam", [HardBeam(), pytest.param(CyclesBeam(), marks=pytest.mark.slow)], ids=["hard", "soft"])
def test_three_frames_tell_how_much_deep_light_there_is_and_how_far_it_goes(beam):
    """Told 1.5 times what there is, and 0.8 times as far: within three stated sigmas, which are below a tenth."""
    scene = scene_of(beam, resolution=300)
    told = scene_of(beam, resolution=300, spread=Spread(amount=1.5, length=0.8))
    tips = ((1.0, 0.0, 4.0), (-1.0, 1.5, 3.5), (0.0, -1.5, 5.0))
    frames = [frame(scene, scene.pose(np.array(tip)), k) for k, tip in enumerate(tips)]
    found = shared_deep(frames, told, NOISE)
    assert all(found.observable.values())
    assert np.all(np.abs(found.values) < 3.0 * found.sigmas)  # logarithms of 1 and 1
    assert np.all(found.sigmas < 0.1)
    assert np.all(found.places >= found.sigmas)
    assert found.applied(told).spread.amount == pytest.approx(math.exp(found.values[0]))


def test_deep_light_that_frames_do_not_tell_stays_as_it_was():
    told = scene_of(spread=Spread(amount=1.5))
    vague = SharedDeep(np.zeros(2), np.diag(np.square([0.3, 0.1])), np.array([0.4, 0.2]), 3)
    assert vague.applied(told).spread == Spread(amount=1.5, length=1.0)
    assert vague.statement().startswith("deep_amount: not observable from this sequence (1.000")
    beyond = SharedDeep(np.array([2.0, 0.0]), np.diag([0.01, 0.01]), np.array([0.4, 0.2]), 3)
    assert beyond.applied(told).spread.amount == 4.0
    assert shared_deep([], told.model_copy(update={"retina": Fundus()})) is None


def test_a_bound_with_deep_light_is_that_of_a_sixth_of_the_edge():
    """Reality's figures (10 um blurred) are 3.1 and 6.7 um; deep light itself tells some."""
    for beam, low, high in ((HardBeam(), 1.5, 3.5), (CyclesBeam(), 5.0, 8.0)):
        sharp, glowing = (
            1e3 * cramer_rao(each, each.pose(np.array([0.0, 0.0, 4.0]))).position_mm
            for each in (scene_of(beam).model_copy(update={"retina": Fundus()}), scene_of(beam))
        )
        assert low < glowing < high
        assert glowing > 1.5 * sharp


def test_the_share_is_the_closed_forms_and_green_light_has_none():
    infrared = Deep.of(scene_of())
    assert infrared.shares[0] == pytest.approx(0.84, abs=0.01)
    assert infrared.kernels[0].reach(0.5) == pytest.approx(0.226, abs=0.01)
    twice = Deep.of(scene_of(spread=Spread(amount=2.0, length=2.0)))
    assert twice.shares[0] / (1.0 - twice.shares[0]) == pytest.approx(2.0 * 0.84 / 0.16, rel=0.1)
    assert twice.kernels[0].reach(0.5) == pytest.approx(0.452, abs=0.02)
    green = scene_of().model_copy(update={"illumination": FlatBand(name="green", low=530.0, high=560.0)})
    assert Deep.of(green) is None


def test_where_the_scene_spreads_light_share_and_length_are_known_to_a_factor_of_two_and_elsewhere_there_is_none():
    glowing = Knowns().within(scene_of())
    assert [each.name for each in glowing.free] == ["deep_amount", "deep_length"]
    assert {glowing.sigma(each) for each in glowing.free} == {DEEP_SIGMA}
    assert Knowns().within(Scene()).free == ()
    assert Knowns(deep_length_sigma=0.0).within(scene_of()).free == glowing.free[:1]
