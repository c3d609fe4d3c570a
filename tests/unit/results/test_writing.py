"""write_results, the report, and `python -m conespot.results`: a run folder alone is enough, and is not trusted."""

import base64
import hashlib
import json
import os
import re
import shutil
import subprocess
import sys
from html.parser import HTMLParser

import pandas as pd
import pytest

from conespot.results import tables_text, write_results
from conespot.results.__main__ import main
from conespot.scene import InputError


@pytest.fixture(scope="session")
def written(tmp_path_factory, make_run, make_rows):
    smooth = make_rows(poses=6, powers=(0.25, 1.0), failing=0.2)
    bumps = make_rows(poses=6, powers=(1.0,), trajectories=("helix",), surfaces=("bumps",), failing=0.2)
    frame = pd.concat([smooth, bumps.assign(case="b" + bumps["case"].str[1:])], ignore_index=True)
    folder = make_run(tmp_path_factory.mktemp("run"), frame, theory=True)
    return folder, write_results(folder)


class Tags(HTMLParser):
    def __init__(self, text):
        super().__init__()
        self.found = []
        self.feed(text)

    def handle_starttag(self, tag, attrs):
        self.found.append((tag, dict(attrs)))


class Page(Tags):
    """A report apart: the scripts that run, the data of its charts, and everything that is neither, with its tags."""

    def __init__(self, text):
        self.programs, self.data, self._kind = [], [], None
        super().__init__(text)
        self.prose = re.sub(r"<(script|style)[^>]*>.*?</\1>", "", text, flags=re.DOTALL)

    def handle_starttag(self, tag, attrs):
        super().handle_starttag(tag, attrs)
        self._kind = (self.data if dict(attrs).get("type") else self.programs) if tag == "script" else None
        if self._kind is not None:
            self._kind.append("")

    def handle_endtag(self, tag):
        self._kind = None

    def handle_data(self, data):
        if self._kind is not None:
            self._kind[-1] += data


def test_a_run_folder_gets_every_file_and_no_other(written):
    folder, files = written
    names = {str(path.relative_to(folder)) for path in files}
    figures = {"figure_8", "figure_9", "figure_10", "figure_11", "along_helix_bumps"}
    assert names == (
        {"boxes.csv", "report.html"}
        | {f"tables/{t}" for t in ("table_1.csv", "table_4.csv", "table_5.csv", "power.csv", "tables.txt", "tables.md")}
        | {f"figures/{f}_paper-code.{kind}" for f in figures for kind in ("png", "svg", "pdf")}
    )
    on_disk = {os.path.relpath(os.path.join(d, f), folder) for d, _, found in os.walk(folder) for f in found}
    assert on_disk == names | {"campaign.yaml", "cases.jsonl", "errors.parquet", "theory.csv"}
    assert all(path.stat().st_size > 0 for path in files)


@pytest.mark.slow
def test_somebody_elses_copy_with_csv_rows_gives_the_same_bytes(written, tmp_path):
    folder, files = written
    pd.read_parquet(folder / "errors.parquet").to_csv(tmp_path / "errors.csv", index=False)
    for name in ("campaign.yaml", "cases.jsonl", "theory.csv"):
        shutil.copy(folder / name, tmp_path)
    again = write_results(tmp_path)
    assert [path.relative_to(tmp_path) for path in again] == [path.relative_to(folder) for path in files]
    for path in again:
        assert path.read_bytes() == (folder / path.relative_to(tmp_path)).read_bytes(), path.name


def test_the_report_needs_nothing_beside_it(written):
    text = (written[0] / "report.html").read_text()
    tags = Tags(text).found
    assert not {tag for tag, _ in tags} & {"link", "iframe", "object", "embed", "base"}
    links = [value for _, attrs in tags for key, value in attrs.items() if key in ("src", "href", "srcset", "action")]
    assert links
    assert all(value.startswith(("data:image/png;base64,", "#")) for value in links)
    assert "url(" not in Page(text).prose


def test_only_the_report_s_own_two_scripts_may_run_in_it(written):
    page = Page((written[0] / "report.html").read_text())
    policy = next(attrs["content"] for tag, attrs in page.found if attrs.get("http-equiv") == "Content-Security-Policy")
    assert policy.startswith("default-src 'none'; ")
    allowed = re.findall(r"'sha256-([^']+)'", policy)
    hashes = [base64.b64encode(hashlib.sha256(script.encode()).digest()).decode() for script in page.programs]
    assert hashes == allowed
    assert len(hashes) == 2
    assert "unsafe-inline" not in policy.split("script-src")[1]


def test_every_figure_of_the_run_is_a_chart_of_the_report(written):
    page = Page((written[0] / "report.html").read_text())
    charts = [json.loads(data) for data in page.data]
    shown = [chart for chart in charts if any(trace["type"] == "box" for trace in chart["data"])]
    boxes = pd.read_csv(written[0] / "boxes.csv")
    means = {round(mean, 9) for chart in shown for t in chart["data"] if t.get("name") == "mean" for mean in t["y"]}
    smooth = boxes[boxes["metric"].isin(["position_error_mm", "rotation_error_deg"]) & (boxes["surface"] == "smooth")]
    assert means == {float(f"{mean:.5g}") for mean in smooth["mean"]}
    assert {f"Fig. {n}" for n in (8, 9, 10, 11)} <= set(re.findall(r"Fig\. \d+", page.prose))


def test_the_report_says_what_a_reader_must_know(written):
    text = re.sub(r"\s+", " ", re.sub(r"<[^>]*>", " ", (written[0] / "report.html").read_text()))
    for needed in (
        "seed 7",
        "mitsuba 3.9.1",
        "campaign run ./campaign.yaml",
        "patch cut by the border",
        "fixed 50 of 255 after median 9",
        "flux from the tip [mW]",
        "3.08",
        "Table I:",
        "Table IV:",
        "Table V:",
        "The text gives 0.133 mm",
        "Tukey",
    ):
        assert needed in text, needed


def test_the_failures_in_the_report_add_up(written):
    folder, _ = written
    text = (folder / "report.html").read_text()
    section = text[text.index('id="failures"') : text.index('id="tables"')]
    lines = [re.findall(r"<td[^>]*>([^<]*)</td>", line) for line in section.split("<tr>")[2:]]
    failed = (pd.read_parquet(folder / "errors.parquet")["status"] == "failed").sum()
    assert sum(int(line[5]) for line in lines) == failed > 0


def test_hostile_text_stays_text(tmp_path, make_run, make_rows, make_cases, make_campaign):
    evil = "<script>alert(1)</script>{{ 7*7 }}"
    frame = make_rows(poses=2, powers=(1.0,), trajectories=("box",), failing=0.5)
    frame.loc[frame["status"] == "failed", "reason"] = evil
    frame["illumination"] = evil
    document = make_campaign(name=evil, description=evil, made_with={evil: evil})
    described = make_cases(frame)
    for case in described:
        case["assumes"] = dict.fromkeys(case["assumes"], evil)
        case["localizers"] = {name: {"threshold": evil, "ambiguity": evil} for name in case["localizers"]}
    folder = make_run(tmp_path / "run", frame, document=document, described=described)
    write_results(folder)
    text = (folder / "report.html").read_text()
    page = Page(text)
    assert len(page.programs) == 2
    assert evil not in text
    assert text.count("&lt;script&gt;") > 5
    charts = [json.loads(data) for data in page.data]
    assert "{{ 7*7 }}" in json.dumps(charts)
    assert "<script" not in json.dumps(charts)
    assert "49" not in re.sub(r"base64,[^\"]*|'sha256-[^']*'", "", re.sub(r"0\.\d+|\d+\.\d+", "", page.prose))
    assert "<script>" not in (folder / "tables" / "tables.md").read_text()


@pytest.mark.parametrize("scene", [None, [], "paper", {"beam": 3, "eye": [], "power": None, "sensor": {"kind": {}}}])
def test_a_campaign_that_describes_no_scene_still_gives_results(tmp_path, make_run, make_rows, make_campaign, scene):
    frame = make_rows(poses=2, powers=(1.0,), trajectories=("box",), rigs=("single",))
    document = make_campaign(scene=scene, sweep=None, name=7, made_with=[1])
    folder = make_run(tmp_path / "run", frame, document=document, described=[])
    write_results(folder)
    assert "not stated" in tables_text(folder)


def test_what_the_rows_no_longer_give_is_removed_and_the_rest_left(tmp_path, make_run, make_rows):
    frame = make_rows(poses=2, powers=(1.0,), trajectories=("box",), rigs=("single",), localizers=("paper",))
    folder = make_run(tmp_path / "run", frame, theory=True)
    write_results(folder)
    (folder / "figures" / "mine.png").write_bytes(b"mine")
    (folder / "theory.csv").unlink()
    frame.assign(localizer="cone").to_parquet(folder / "errors.parquet")
    files = write_results(folder)
    kept = {path.name for name in ("tables", "figures") for path in (folder / name).iterdir()}
    assert kept == {path.name for path in files if path.parent != folder} | {"mine.png"}
    assert (folder / "figures" / "mine.png").read_bytes() == b"mine"


def test_theory_alone_is_a_run(tmp_path, make_run):
    folder = make_run(tmp_path / "run", theory=True, document={"name": "theory", "theory": ["table-1"], "seed": 1})
    names = [path.name for path in write_results(folder)]
    assert names == ["table_1.csv", "tables.txt", "tables.md", "report.html"]
    assert "Table I" in tables_text(folder)


def test_an_interrupted_write_leaves_no_half_file(tmp_path, make_run, make_rows, monkeypatch):
    folder = make_run(tmp_path / "run", make_rows(poses=2, powers=(1.0,)))

    def interrupt(*_):
        raise KeyboardInterrupt

    monkeypatch.setattr("conespot.results.writing.drawn_meanwhile", interrupt)
    with pytest.raises(KeyboardInterrupt):
        write_results(folder)
    assert not (folder / "report.html").exists()
    assert not [path for path in folder.rglob("*") if path.suffix == ".tmp"]


def test_a_link_out_of_the_run_folder_is_not_followed(tmp_path, make_run, make_rows):
    folder = make_run(tmp_path / "run", make_rows(poses=2, powers=(1.0,)))
    (tmp_path / "elsewhere").mkdir()
    (folder / "figures").symlink_to(tmp_path / "elsewhere")
    with pytest.raises(InputError, match="is a link to somewhere else"):
        write_results(folder)
    assert not list((tmp_path / "elsewhere").iterdir())


def test_a_file_where_a_folder_is_needed_is_one_clear_sentence(tmp_path, make_run, make_rows):
    folder = make_run(tmp_path / "run", make_rows(poses=2, powers=(1.0,)))
    (folder / "tables").touch()
    with pytest.raises(InputError, match="tables: cannot be made"):
        write_results(folder)


def test_the_command_prints_the_tables(tmp_path, make_run, capsys):
    folder = make_run(tmp_path / "run", theory=True)
    assert main([str(folder)]) == 0
    assert "Table I" in capsys.readouterr().out


def test_the_command_refuses_what_is_no_run_with_exit_code_2(tmp_path):
    done = subprocess.run(
        [sys.executable, "-m", "conespot.results", str(tmp_path)], capture_output=True, text=True, check=False
    )
    assert (done.returncode, done.stdout) == (2, "")
    assert done.stderr.count("\n") == 1
    assert "no campaign.yaml" in done.stderr


def test_a_text_of_nothing_says_what_to_do(tmp_path):
    with pytest.raises(InputError, match="python -m conespot.results"):
        tables_text(tmp_path)
