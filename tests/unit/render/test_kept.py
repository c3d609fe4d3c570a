"""Backgrounds that are kept on disk: found again, never believed when damaged, and bounded."""

import os
import threading

import numpy as np
import pytest

from conespot.render import Renderer, kept
from conespot.scene import Camera, Scene
from conespot.scene.beam import HardBeam
from conespot.scene.illumination import Ambient
from conespot.scene.retina import UniformRetina
from conespot.scene.spotlights import RIGS, Instrument, Shaft

SHAPE = (40, 30, 1)


@pytest.fixture(autouse=True)
def place(tmp_path, monkeypatch):
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    monkeypatch.delenv(kept.SWITCH)
    return tmp_path / "conespot"


def image(seed=0):
    return np.random.default_rng(seed).uniform(size=SHAPE).astype(np.float32)


def never():
    pytest.fail("rendered again")


def test_what_is_kept_is_found_to_the_byte_and_cannot_be_written_to():
    kept.kept("a", SHAPE, image)
    found = kept.kept("a", SHAPE, never)
    np.testing.assert_array_equal(found, image())
    assert found.dtype == np.float32
    assert not found.flags.writeable


@pytest.mark.parametrize(
    "harm",
    [
        lambda data: data[:-4],
        lambda data: data + b"0000",
        lambda data: b"",
        lambda data: data[:500] + bytes([data[500] ^ 1]) + data[501:],
        lambda data: bytes([data[0] ^ 1]) + data[1:],
    ],
    ids=["torn", "longer", "empty", "one bit of a pixel", "another digest"],
)
def test_a_damaged_file_is_not_believed_and_is_mended(place, harm):
    kept.kept("a", SHAPE, image)
    (file,) = place.iterdir()
    file.write_bytes(harm(file.read_bytes()))
    np.testing.assert_array_equal(kept.kept("a", SHAPE, lambda: image(1)), image(1))
    np.testing.assert_array_equal(kept.kept("a", SHAPE, never), image(1))


def test_a_file_under_another_s_name_is_not_believed(place):
    kept.kept("a", SHAPE, image)
    (file,) = place.iterdir()
    file.rename(place / "b.background")
    np.testing.assert_array_equal(kept.kept("b", SHAPE, lambda: image(1)), image(1))


def test_writers_at_once_leave_one_whole_file(place):
    """Eight threads that render the same image when none is there yet."""
    ready = threading.Barrier(8)

    def render():
        ready.wait()
        return image()

    found = []
    threads = [threading.Thread(target=lambda: found.append(kept.kept("a", SHAPE, render))) for _ in range(8)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert len(found) == 8
    assert all(np.array_equal(one, image()) for one in found)
    assert [file.name for file in place.iterdir()] == ["a.background"]


def test_what_was_not_used_for_longest_goes_first(place, monkeypatch):
    """Room for three; the first is used again before the fourth comes."""
    monkeypatch.setattr(kept, "LIMIT", 3 * (image().nbytes + 100))
    for age, name in enumerate("abc"):
        kept.kept(name, SHAPE, image)
        os.utime(place / f"{name}.background", (age, age))
    kept.kept("a", SHAPE, never)
    kept.kept("d", SHAPE, image)
    assert sorted(file.stem for file in place.iterdir()) == ["a", "c", "d"]
    assert kept.occupied()[0] == 3


def test_an_image_beyond_the_limit_is_not_kept(place, monkeypatch):
    monkeypatch.setattr(kept, "LIMIT", 100)
    np.testing.assert_array_equal(kept.kept("a", SHAPE, image), image())
    assert not list(place.iterdir())


def test_what_a_killed_process_left_is_removed_when_it_is_old(place):
    place.mkdir()
    for name, age in ((".old", 1.0), (".new", None)):
        (place / name).write_bytes(b"half")
        if age:
            os.utime(place / name, (age, age))
    kept.kept("a", SHAPE, image)
    assert sorted(file.name for file in place.iterdir()) == [".new", "a.background"]


@pytest.mark.parametrize("value", ["off", "OFF", "0"])
def test_it_can_be_switched_off(place, monkeypatch, value):
    monkeypatch.setenv(kept.SWITCH, value)
    assert kept.folder() is None
    kept.kept("a", SHAPE, image)
    assert not place.exists()
    assert kept.clear() == 0


def test_what_somebody_holds_is_given_again_without_a_cache_too(monkeypatch):
    monkeypatch.setenv(kept.SWITCH, "off")
    held = kept.kept("a", SHAPE, image)
    assert kept.kept("a", SHAPE, never) is held
    del held
    np.testing.assert_array_equal(kept.kept("a", SHAPE, lambda: image(1)), image(1))


def test_a_cache_that_cannot_be_written_is_none(tmp_path, monkeypatch):
    (tmp_path / "file").write_text("")
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "file"))
    assert kept.folder() is None
    np.testing.assert_array_equal(kept.kept("a", SHAPE, image), image())


def test_clearing_says_what_it_frees(place):
    kept.kept("a", SHAPE, image)
    kept.kept("b", SHAPE, image)
    count, size = kept.occupied()
    assert count == 2
    assert kept.clear() == size == 2 * (image().nbytes + 64)
    assert not list(place.iterdir())


def test_a_background_is_rendered_once_for_all_rigs_and_anew_for_another_view():
    """Renderers in turn: how often each renders a background, and its bytes against those without a cache."""
    scene = Scene(camera=Camera(resolution=64), retina=UniformRetina())
    first = Renderer(scene)
    background = first.background()
    assert first.rendered == 1
    for other in (
        {"spotlights": RIGS["triple"]},
        {"beam": HardBeam()},
        {"instrument": Instrument(shaft=Shaft())},
        {"power": scene.power.model_copy(update={"value": 0.3})},
    ):
        renderer = Renderer(scene.model_copy(update=other))
        np.testing.assert_array_equal(renderer.background(), background)
        assert renderer.rendered == 0
    for other in ({"ambient": Ambient(irradiance=2.0)}, {"retina": UniformRetina(albedo=0.2)}):
        renderer = Renderer(scene.model_copy(update=other))
        assert not np.array_equal(renderer.background(), background)
        assert renderer.rendered == 1
