"""The choice of variant and LLVM, each in a process of its own, since Mitsuba is loaded once a process."""

from __future__ import annotations

import os
import subprocess
import sys
from importlib.metadata import distributions
from pathlib import Path

import pytest

from conespot.render import kernel

ROOMS = ("scene", "render", "localize", "campaigns", "results")
REPORT = "from conespot.render.kernel import load; print(load()[2])"


def run(code, **environment):
    return subprocess.run(
        [sys.executable, "-c", code],
        env={**os.environ, **environment},
        capture_output=True,
        text=True,
        timeout=120,
        check=False,
    )


@pytest.mark.parametrize(
    ("name", "version"),
    [("libLLVM-14.so.1", 14), ("libLLVM.so.23.1", 23), ("libLLVM-16.0.6.so.1", 16), ("libLLVM.so.19.1", 19)],
)
def test_llvm_version_is_read_from_the_file_name(tmp_path, name, version):
    (tmp_path / name).touch()
    assert kernel.llvm_version(tmp_path / name) == version


def test_llvm_version_follows_links_to_the_real_name(tmp_path):
    (tmp_path / "libLLVM.so.21.1").touch()
    (tmp_path / "libLLVM.so").symlink_to(tmp_path / "libLLVM.so.21.1")
    assert kernel.llvm_version(tmp_path / "libLLVM.so") == 21


def test_an_old_llvm_is_refused_with_one_line_and_the_scalar_variant_renders(tmp_path):
    old = tmp_path / "libLLVM-16.so.1"
    old.write_bytes(b"not a library")
    code = REPORT + "\nfrom render.doctor import examine\nprint(*examine(), sep='\\n')"
    done = run(code, DRJIT_LIBLLVM_PATH=str(old), CUDA_VISIBLE_DEVICES="")
    assert done.returncode == 0, done.stderr
    assert "scalar_spectral" in done.stdout
    assert "agrees" in done.stdout
    assert "LLVM 19 or newer is needed" in done.stderr
    assert str(old) in done.stderr


def test_an_unknown_variant_is_refused_by_name():
    done = run(REPORT, CONESPOT_VARIANT="llvm_spectral")
    assert done.returncode != 0
    assert "CONESPOT_VARIANT=llvm_spectral: no such variant" in done.stderr


@pytest.mark.skipif(
    not any(found.name == "karellen-llvm-core" for found in distributions()),
    reason="karellen-llvm-core, which brings an LLVM, is not installed here",
)
def test_the_wheels_llvm_is_found_without_any_setting(monkeypatch):
    monkeypatch.delenv("DRJIT_LIBLLVM_PATH", raising=False)
    library, _ = kernel.find_llvm()
    assert library is not None
    assert (kernel.llvm_version(library) or 0) >= kernel.MINIMUM_LLVM


def test_scene_and_localize_do_not_import_mitsuba():
    rooms = ", ".join(f"conespot.{room}" for room in ROOMS)
    done = run(f"import sys, {rooms}; assert not {{'mitsuba', 'drjit'}} & set(sys.modules)")
    assert done.returncode == 0, done.stderr


def test_only_the_kernel_imports_mitsuba():
    root = Path(kernel.__file__).parents[1]
    files = [p for room in ROOMS for p in (root / room).rglob("*.py")]
    guilty = [p.name for p in files if "import mitsuba" in p.read_text() or "import drjit" in p.read_text()]
    assert guilty == ["kernel.py"]
