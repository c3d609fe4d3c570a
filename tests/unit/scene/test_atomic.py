"""scene.atomic: a file is whole or not there."""

import os
import stat

import pytest

from conespot.scene import InputError
from conespot.scene.atomic import write_atomically


def test_replaces_the_old_content_and_leaves_nothing_else(tmp_path):
    path = tmp_path / "table.csv"
    write_atomically(path, b"old")
    write_atomically(path, b"new")
    assert path.read_bytes() == b"new"
    assert os.listdir(tmp_path) == ["table.csv"]


def test_gives_the_usual_permissions(tmp_path):
    plain = tmp_path / "plain"
    plain.touch()
    write_atomically(tmp_path / "table.csv", b"")
    assert stat.S_IMODE((tmp_path / "table.csv").stat().st_mode) == stat.S_IMODE(plain.stat().st_mode)


def test_an_interrupted_write_keeps_the_old_content(tmp_path, monkeypatch):
    path = tmp_path / "table.csv"
    path.write_bytes(b"old")

    def interrupt(_):
        raise KeyboardInterrupt

    monkeypatch.setattr(os, "fsync", interrupt)
    with pytest.raises(KeyboardInterrupt):
        write_atomically(path, b"new")
    assert path.read_bytes() == b"old"
    assert os.listdir(tmp_path) == ["table.csv"]


def test_a_missing_folder_is_one_clear_sentence(tmp_path):
    with pytest.raises(InputError, match=r"table\.csv: cannot be written: No such file or directory"):
        write_atomically(tmp_path / "absent" / "table.csv", b"new")


def test_a_folder_in_the_way_is_one_clear_sentence_and_no_litter(tmp_path):
    (tmp_path / "table.csv").mkdir()
    with pytest.raises(InputError, match="cannot be written"):
        write_atomically(tmp_path / "table.csv", b"new")
    assert os.listdir(tmp_path) == ["table.csv"]


def test_a_pipe_in_the_way_is_one_clear_sentence_and_stays_one(tmp_path):
    os.mkfifo(tmp_path / "pipe")
    with pytest.raises(InputError, match="is a device or a pipe, no file; choose another --csv"):
        write_atomically(tmp_path / "pipe", b"new", "--csv")
    assert (tmp_path / "pipe").is_fifo()
