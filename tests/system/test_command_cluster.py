"""One process, a scheduler with two workers, merged shards: the same bytes; another variant: nearly the same."""

import os
import subprocess
import sys

import numpy as np
import pandas as pd
import pytest

pytestmark = pytest.mark.slow

TEXT = """\
scene: {preset: paper-code, camera: {resolution: 300}}
trajectory: random
poses: 2
samples: 16
localizers: [paper]
sweep:
  scene.power.value: [0.25 W, 1 W]
  scene.surface: [smooth, bumps]
"""


def campaign(*arguments, cwd, **environment):
    done = subprocess.run(
        [sys.executable, "-m", "conespot", *map(str, arguments)],
        cwd=cwd,
        env={**os.environ, **environment},
        capture_output=True,
        text=True,
        timeout=300,
    )
    assert done.returncode == 0, done.stderr
    return done


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    path = tmp_path_factory.mktemp("cluster")
    (path / "c.yaml").write_text(TEXT)
    (path / "here.yaml").write_text("kind: local\nworkers: 2\n")
    campaign("run", "c.yaml", "--workers", 1, "--out", "one", cwd=path)
    return path


def test_dask_with_two_workers_and_merged_shards_give_the_bytes_of_one_process(folder):
    rows = (folder / "one" / "errors.parquet").read_bytes()
    campaign("run", "c.yaml", "--profile", "here.yaml", "--out", "dask", cwd=folder)
    assert (folder / "dask" / "errors.parquet").read_bytes() == rows
    for shard in ("1/2", "2/2"):
        campaign("run", "c.yaml", "--workers", 1, "--shard", shard, cwd=folder)
    done = campaign("merge", "merged", "runs/c-1-of-2", "runs/c-2-of-2", cwd=folder)
    assert "merged: errors.csv, errors.parquet" in done.stdout
    assert (folder / "merged" / "errors.parquet").read_bytes() == rows


def test_another_variant_finds_the_same_within_the_stated_tolerance(folder):
    """5 um at 300 px and 256 samples, where 1 um was measured (docs/cluster.md): the noise of the renderer."""
    options = ["--samples", 256, "--poses", 3, "--localizers", "cone", "--set", "sweep={}", "--workers", 1]
    campaign("run", "c.yaml", *options, "--out", "fast", cwd=folder, CONESPOT_VARIANT="llvm_ad_spectral")
    campaign("run", "c.yaml", *options, "--out", "scalar", cwd=folder, CONESPOT_VARIANT="scalar_spectral")
    fast, scalar = (pd.read_parquet(folder / name / "errors.parquet") for name in ("fast", "scalar"))
    keys = ["case", "localizer", "pose", "status"]
    assert fast[keys].equals(scalar[keys])
    assert set(fast["status"]) == {"ok"}
    tips = [f"est_{axis}_mm" for axis in "xyz"]
    apart = np.linalg.norm(fast[tips].to_numpy() - scalar[tips].to_numpy(), axis=-1)
    assert 0.0 < apart.max() < 0.005
    assert b"variant scalar_spectral" in (folder / "scalar" / "journal.jsonl").read_bytes()
