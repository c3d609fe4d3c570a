"""Files from strangers: bounded, never waited for, and refused in one sentence."""

import os
import threading
from pathlib import Path

import pytest

from conespot.scene import InputError, load_scene
from conespot.scene.document import find_document, read_document


def refused(path):
    with pytest.raises(InputError) as error:
        read_document(Path(path))
    assert "\n" not in str(error.value)
    return str(error.value)


def test_a_pipe_is_read_to_its_end_and_one_without_a_writer_is_empty(tmp_path):
    os.mkfifo(tmp_path / "pipe")
    assert "is empty" in refused(tmp_path / "pipe")
    reading, writing = os.pipe()

    def write_slowly():
        for part in (b"eye: {radius:", b" 11 mm}"):
            os.write(writing, part)
            threading.Event().wait(0.05)
        os.close(writing)

    writer = threading.Thread(target=write_slowly)
    writer.start()
    assert load_scene(f"/dev/fd/{reading}").eye.radius == 11.0
    writer.join()
    os.close(reading)


def test_what_never_ends_or_is_no_file_is_refused_at_once(tmp_path):
    assert "larger than" in refused("/dev/zero")
    assert "is empty" in refused("/dev/null")
    assert "Is a directory" in refused(tmp_path)
    with (tmp_path / "sparse.yaml").open("wb") as stream:
        stream.truncate(100_000_000_000)
    assert "sparse.yaml: larger than 0.256 MB, which no description needs" in refused(tmp_path / "sparse.yaml")


def test_a_folder_named_like_a_preset_does_not_hide_it(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "paper-code").mkdir()
    (tmp_path / "mine.yaml").write_text("preset: paper-code\n")
    assert load_scene("paper-code") == load_scene("mine.yaml")
    (tmp_path / "mine").mkdir()
    with pytest.raises(InputError, match="mine: is a folder; name the scene preset's file in it"):
        load_scene("mine")


@pytest.mark.parametrize("name", ["a" * 5000, "a\0b", "", "~nobody-of-that-name/x", "/dev/null/x", "a/" * 3000])
def test_a_name_that_cannot_be_one_is_no_such_file(name):
    with pytest.raises(InputError):
        load_scene(name)


def test_a_home_is_written_as_in_a_shell_unless_something_has_that_very_name(tmp_path, monkeypatch):
    monkeypatch.setenv("HOME", str(tmp_path / "home"))
    monkeypatch.chdir(tmp_path)
    (tmp_path / "home").mkdir()
    (tmp_path / "home" / "a scene.yaml").write_text("eye: {radius: 11 mm}")
    assert load_scene("~/a scene.yaml").eye.radius == 11.0
    (tmp_path / "~").mkdir()
    (tmp_path / "~" / "a scene.yaml").write_text("eye: {radius: 12 mm}")
    assert find_document("~/a scene.yaml", "scene", "presets", "scene preset").resolve().parent == tmp_path / "~"


@pytest.mark.parametrize("encoding", ["utf-8-sig", "utf-16"])
def test_a_description_saved_by_an_editor_with_its_mark_is_read(tmp_path, encoding):
    (tmp_path / "x.yaml").write_bytes("eye: {radius: 11 mm} # Ä\r\n".encode(encoding))
    assert load_scene(tmp_path / "x.yaml").eye.radius == 11.0


HOSTILE = {
    "deep": "a: " + "[" * 40 + "]" * 40,
    "very deep": "{a: " * 60_000,
    "many values": "a: [" + "1," * 100_000 + "1]",
    "laughs": "a: &a [x]\nb: &b [*a, *a]\nc: [*b, *b]",
    "twice the same anchor": "a: &a 1\nb: &a 2",
    "many digits": "camera: {resolution: " + "9" * 5000 + "}",
    "a huge hexadecimal": "camera: {resolution: 0x" + "f" * 5000 + "}",
    "beyond all floats": "camera: {resolution: 1e400}",
    "no number": "camera: {resolution: .nan}",
    "a merge key": "eye:\n  <<: {radius: 12 mm}",
    "a tab": "eye:\n\tradius: 12 mm",
    "a null": "eye: \x00",
    "two documents": "eye: {radius: 12 mm}\n---\neye: {radius: 13 mm}",
    "a surrogate": 'eye: "\\ud800"',
    "a list for a key": "? [1]\n: 2",
    "a long quantity": "eye: {radius: " + "1" * 5000 + " mm}",
    "a set": "eye: !!set {a}",
    "Latin-1": b"eye: \xe4",
}


@pytest.mark.parametrize("name", HOSTILE)
def test_hostile_yaml_is_refused_in_one_short_sentence(tmp_path, name):
    text = HOSTILE[name]
    (tmp_path / "x.yaml").write_bytes(text if isinstance(text, bytes) else text.encode())
    with pytest.raises(InputError) as error:
        load_scene(tmp_path / "x.yaml")
    said = str(error.value)
    assert "\n" not in said
    assert len(said) < 600 + len(str(tmp_path))
