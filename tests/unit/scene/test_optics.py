"""The eye's optics against other people's tracers, and what is said of them."""

import csv
import math
from pathlib import Path

import numpy as np
import pytest
from pydantic import ValidationError

from conespot.scene import media
from conespot.scene.optics import Optics

REFERENCE = Path(__file__).parents[2] / "data" / "optics_reference.csv"


def reference():
    lines = [line for line in REFERENCE.read_text("utf-8").splitlines() if not line.startswith("#")]
    found = {}
    for row in csv.DictReader(lines):
        key = tuple(row[name] for name in ("eye", "lens", "contact", "refraction_d", "wavelength_nm"))
        found.setdefault(key, []).append(
            (row["rays"], [float(row[name]) for name in ["ox", "oy", "oz", "dx", "dy", "dz", "x", "y", "z"]])
        )
    return found


def on_retina(optics, origin, direction):
    """Where rays in the vitreous meet the retina of the model eye, an ellipsoid about (0, 0, c)."""
    axes = np.array(optics.model.retina)
    start, way = (origin - [0.0, 0.0, axes[2]]) / axes, direction / axes
    a, b, c = (np.sum(p * q, axis=-1) for p, q in ((way, way), (start, way), (start, start)))
    along = (-b + np.sqrt(b * b - a * (c - 1.0))) / a
    return origin + along[..., None] * direction


def entered(optics, origins, directions, wavelength):
    origin, direction, off = optics.enter(tuple(origins.T), tuple(directions.T), wavelength, np.sqrt)
    return np.stack(np.broadcast_arrays(*origin), -1), np.stack(np.broadcast_arrays(*direction), -1), off


@pytest.mark.parametrize("key", reference(), ids=" ".join)
def test_rays_meet_the_retina_where_optiland_and_visisipy_say(key):
    """Hits on the retina of rays in the air, against benchmarks/peer_optics.py's table: within 0.5 um.

    Chief rays through the middle of the pupil at 20 deg to either side, and twelve of the scene's own camera, a pinhole
    110 mm above the pole. Navarro's interpolated indices on both sides, but for visisipy's rays, which have those
    published for the wide-angle eye, of four digits.
    """
    eye, lens, contact, refraction, wavelength = key
    optics = Optics(eye=eye, lens=lens, contact=contact, refraction=float(refraction))
    rays = np.array([numbers for _, numbers in reference()[key]])
    origins, directions, off = entered(optics, rays[:, :3], rays[:, 3:6], float(wavelength))
    hits = on_retina(optics, origins, directions)
    assert np.linalg.norm(hits - rays[:, 6:], axis=1).max() < 0.5e-3
    assert np.ptp(rays[:, 6:], axis=0).max() > 0.5
    chief = [kind == "chief" for kind, _ in reference()[key]]
    assert off[chief].max() < 1e-4  # through the middle


def test_the_table_has_the_rays_it_should():
    keys, kinds = reference(), {kind for rays in reference().values() for kind, _ in rays}
    assert kinds == {"chief", "pinhole", "visisipy"}
    assert {key[1:3] for key in keys} == {
        (lens, c) for lens in ("phakic", "aphakic", "pseudophakic") for c in ("none", "flat")
    }
    assert len({key[4] for key in keys if key[0] == "navarro"}) == 3


@pytest.mark.parametrize(
    ("wavelength", "published"),
    [
        (458.0, (1.3828, 1.3445, 1.4292, 1.3428)),
        (543.0, (1.3777, 1.3391, 1.4222, 1.3377)),
        (589.3, (1.376, 1.3374, 1.42, 1.336)),
        (632.8, (1.3747, 1.336, 1.4183, 1.3347)),
    ],
)
def test_indices_are_those_of_navarros_wide_angle_eye(wavelength, published):
    """Navarro 1985's interpolation against the table of Escudero-Sanz & Navarro 1999, which has four digits."""
    found = [media.index(name, wavelength) for name in ("cornea", "aqueous", "lens", "vitreous")]
    np.testing.assert_allclose(found, published, rtol=0.0, atol=1.6e-4)


def test_dispersion_falls_all_the_way_to_1000_nm():
    wavelengths = np.linspace(380.0, 1000.0, 63)
    for name in ("cornea", "aqueous", "lens", "vitreous", "pmma"):
        assert np.all(np.diff(media.index(name, wavelengths)) < 0.0)


def test_transmission_is_the_published_one():
    """Densities of van de Kraats & van Norren 2007 at 20, 50 and 70 years, large field."""
    table = {
        400.0: (1.5225, 2.1226, 2.80843),
        460.0: (0.280175, 0.442066, 0.627085),
        850.0: (0.122642, 0.125835, 0.129484),
    }
    for wavelength, densities in table.items():
        found = [-math.log10(media.transmission(wavelength, age)) for age in (20.0, 50.0, 70.0)]
        np.testing.assert_allclose(found, densities, rtol=0.0, atol=2e-5)
    assert media.transmission(450.0, None) > media.transmission(450.0, 20.0)


def test_parallel_light_meets_at_the_pole_of_an_emmetropic_eye():
    """Paraxial rays along the axis at 589.3 nm: the Navarro and Le Grand eyes are emmetropic to 0.3 D."""
    for eye in ("navarro", "le-grand"):
        optics = Optics(eye=eye)
        origin, direction, _ = entered(optics, np.array([[0.01, 0.0, 40.0]]), np.array([[0.0, 0.0, -1.0]]), 589.3)
        focus = origin[0, 2] - origin[0, 0] / direction[0, 0] * direction[0, 2]
        assert abs(focus) < 0.3e-3 * 17.0**2 * 1.336  # a dioptre is 0.39 mm of depth


def test_a_myopic_eye_is_longer_and_its_retina_less_flat():
    flat, long = (Optics(eye="atchison", lens="aphakic", refraction=d) for d in (0.0, -5.0))
    assert flat.model.length == pytest.approx(23.58)
    assert long.model.length == pytest.approx(23.58 + 5 * 0.299)
    assert long.model.retina[2] / long.model.retina[0] > flat.model.retina[2] / flat.model.retina[0]


@pytest.mark.parametrize(
    ("wrong", "said"),
    [
        ({"pupil": -1.0}, "greater than 0"),
        ({"pupil": 0.0}, "greater than 0"),
        ({"eye": "atchison"}, "graded"),
        ({"eye": "navarro", "refraction": -2.0}, "no other refraction"),
        ({"eye": "gullstrand"}, "navarro"),
    ],
)
def test_optics_that_cannot_be_are_refused(wrong, said):
    with pytest.raises(ValidationError, match=said):
        Optics(**wrong)
