"""Localizers of another installed distribution: listed, used in a campaign, and harmless when they break."""

import functools
import os
import subprocess
import sys
from pathlib import Path

import pandas as pd
import pytest

#: the localizer that the documentation adds, as it stands there
EXTENDING = (Path(__file__).parents[2] / "docs" / "extending.md").read_text("utf-8")
ADDED = EXTENDING.partition(" # beacon.py\n")[2].partition(" # pyproject.toml")[0]
BRIGHTEST = "".join(f"{line[1:]}\n" for line in ADDED.splitlines() if line.startswith("+"))
BEACON = """\

from conespot.localize import Localizer

def _told(image, scene, beside):
    assert beside.truth is None and beside.knowns.rcm_sigma_mm == 0.2
    return brightest(image, scene)

told = Localizer(_told, threshold="none (a guess)", ambiguity="none (a guess)", takes_knowledge=True)

def _oracle(image, scene, beside):
    return Localization(beside.truth.apex, beside.truth.axis)

seer = Localizer(_oracle, needs_truth=True)

def raises(image, scene):
    raise RuntimeError("no such luck")

def writes(image, scene):
    image[:] = 0

def answers_a_word(image, scene):
    return "there"

def answers_nan(image, scene):
    return Localization(np.array([0.0, 0.0, np.nan]), np.array([0.0, 0.0, -1.0]))

def leaves(image, scene):
    raise SystemExit(3)

none = 5
"""
#: the command without figures, which of nine localizers take a minute
UNDRAWN = """\
import sys
from conespot.results import writing
from conespot.campaigns.command import main

writing.plan_figures = lambda run, boxes: ([], 0)
sys.exit(main())
"""
#: exit codes for several files
VALIDATE = """\
import sys
from conespot.campaigns.command import main

print(*(int(main(["validate", name])) for name in sys.argv[1:]))
"""
NAMES = ["brightest", "told", "seer", "raises", "writes", "answers_a_word", "answers_nan", "leaves"]


@pytest.fixture(scope="module")
def installed(tmp_path_factory):
    """A folder on the path with a module, and the metadata that makes it an installed distribution."""
    site = tmp_path_factory.mktemp("site")
    (site / "beacon.py").write_text(BRIGHTEST + BEACON)
    metadata = site / "beacon-1.0.dist-info"
    metadata.mkdir()
    (metadata / "METADATA").write_text("Metadata-Version: 2.1\nName: beacon\nVersion: 1.0\n")
    entries = [f"{name} = beacon:{name}" for name in (*NAMES, "none")]
    shadow = "paper = beacon:raises"
    (metadata / "entry_points.txt").write_text(
        "\n".join(["[conespot.localizers]", *entries, "gone = no_such_module:f", shadow, ""])
    )
    return site


def python(code, *arguments, installed, cwd):
    environment = {**os.environ, "PYTHONPATH": str(installed)}
    command = [sys.executable, "-c", code, *map(str, arguments)]
    return subprocess.run(command, cwd=cwd, env=environment, capture_output=True, text=True, timeout=120)


@pytest.fixture
def campaign(installed, tmp_path):
    return functools.partial(python, UNDRAWN, installed=installed, cwd=tmp_path)


def test_they_are_listed_with_their_words_and_what_is_wrong_with_them(campaign):
    done = campaign("list", "--localizers")
    assert done.returncode == 0, done.stderr
    lines = {line.split()[0]: line for line in done.stdout.splitlines()}
    assert next(iter(lines)) == "paper"
    assert "Otsu" in lines["paper"], "nobody takes the name of a localizer of this package"
    assert lines["told"].endswith("threshold: none (a guess); ambiguity: none (a guess); takes knowledge; beacon:told")
    assert "threshold: not stated; ambiguity: not stated; needs the truth" in lines["seer"]
    assert "(no_such_module:f of beacon 1.0) cannot be loaded: ModuleNotFoundError" in lines["gone"]
    assert "is no conespot.localize.localizer.Localizer and no function" in lines["none"]


@pytest.mark.slow
def test_a_campaign_uses_them_and_what_breaks_is_a_failure_row(campaign, tmp_path):
    (tmp_path / "c.yaml").write_text(
        "scene: {preset: paper, camera: {resolution: 100}}\nposes: 1\nsamples: 1\nknowledge: {rcm_sigma: 0.2 mm}\n"
        f"localizers: [{', '.join(NAMES)}, paper-code-float]\n"
    )
    done = campaign("run", "c.yaml", "--workers", 1, "--out", "run")
    assert done.returncode == 0, done.stderr
    rows = pd.read_csv(tmp_path / "run" / "errors.csv", keep_default_na=False).set_index("localizer")
    assert dict(zip(rows.index, rows["reason"], strict=True)) | {"paper-code-float": ""} == {
        "brightest": "",
        "told": "",
        "seer": "",
        "raises": "raises raised RuntimeError: no such luck",
        "writes": "writes raised ValueError: assignment destination is read-only",
        "answers_a_word": "answers_a_word broke its word: it answered str, no Localization or LocalizationFailure",
        "answers_nan": "answers_nan broke its word: apex_mm must be three finite numbers",
        "leaves": "leaves raised SystemExit: 3",
        "paper-code-float": "",
    }
    assert float(rows["position_error_mm"]["seer"]) == 0.0
    assert '"told": {"threshold": "none (a guess)"' in (tmp_path / "run" / "cases.jsonl").read_text()


def test_one_that_cannot_be_used_is_refused_in_a_sentence_with_its_line(installed, tmp_path):
    refused = {
        "gone": "localizer 'gone' (no_such_module:f of beacon 1.0) cannot be loaded: ModuleNotFoundError",
        "none": "localizer 'none' (beacon:none of beacon 1.0) is no conespot.localize.localizer.Localizer",
        "brightes": "unknown localizer 'brightes'; did you mean 'brightest'?",
    }
    for name in refused:
        (tmp_path / f"{name}.yaml").write_text(f"scene: paper\nlocalizers:\n- {name}\n")
    done = python(VALIDATE, *(f"{name}.yaml" for name in refused), installed=installed, cwd=tmp_path)
    assert done.stdout == "2 2 2\n"
    for said, (name, says) in zip(done.stderr.splitlines(), refused.items(), strict=True):
        assert said.startswith(f"campaign: {name}.yaml:3: localizers.0: {says}")
