"""write_results, the report, and `python -m conespot.results`: a run folder alone is enough, and is not trusted."""

import base64
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


def test_a_run_folder_gets_every_file_and_no_other(written):
    folder, files = written
    names = {str(path.relative_to(folder)) for path in files}
    figures = {"figure_8", "figure_9", "figure_10", "figure_11", "along_helix_bumps"}
    assert names == (
        {"boxes.csv", "report.html"}
        | {f"tables/{t}" for t in ("table_1.csv", "table_4.csv", "table_5.csv", "power.csv", "tables.txt", "tables.md")}
        | {f"figures/{f}_paper-code.{kind}" for f in figures for kind in ("png", "svg")}
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
    folder, files = written
    tags = Tags((folder / "report.html").read_text()).found
    assert not {tag for tag, _ in tags} & {"script", "link", "iframe", "object", "embed", "base", "form"}
    links = [value for _, attrs in tags for key, value in attrs.items() if key in ("src", "href", "srcset", "action")]
    assert all(value.startswith(("data:image/png;base64,", "#")) for value in links)
    images = [base64.b64decode(value.split(",")[1]) for value in links if value.startswith("data:")]
    assert sorted(images) == sorted(path.read_bytes() for path in files if path.suffix == ".png")
    assert "url(" not in (folder / "report.html").read_text()


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
    section = text[text.index('id="failures"') : text.index('id="assumptions"')]
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
    assert "script" not in {tag for tag, _ in Tags(text).found}
    assert text.count("&lt;script&gt;") > 5
    assert "49" not in re.sub(r"base64,[^\"]*", "", re.sub(r"0\.\d+|\d+\.\d+", "", text))
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

    monkeypatch.setattr("conespot.results.writing.draw_figures", interrupt)
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
