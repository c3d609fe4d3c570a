"""README and the pages of docs/: links lead somewhere, commands are this command's, and what is marked runs."""

import os
import re
import shlex
import subprocess
import sys
from pathlib import Path

import pytest

from conespot.campaigns.command_line import parser

PROJECT = Path(__file__).parents[2]
PAGES = {path.relative_to(PROJECT).as_posix(): path for path in (PROJECT / "README.md", *PROJECT.glob("docs/*.md"))}
_BLOCK = re.compile(r"(?:<!-- run(?:: (?P<files>[^>]*?))? -->\n)?```(?P<kind>\w+)\n(?P<text>.*?)```", re.S)
_MARK = "<!-- run"
MARKED = sorted(name for name, path in PAGES.items() if _MARK in path.read_text("utf-8"))


def blocks(page):
    return list(_BLOCK.finditer(PAGES[page].read_text("utf-8")))


def commands(page):
    """Every line of a page's shell blocks that calls `campaign`, and every indented one that begins with it."""
    text = "\n".join(b["text"] for b in blocks(page) if b["kind"] == "sh")
    text += "\n".join(re.findall(r"^    (campaign .*)$", PAGES[page].read_text("utf-8"), re.M))
    for line in text.splitlines():
        for part in re.split(r"&&|;", line.partition(" #")[0]):
            if (words := shlex.split(part)) and words[0].rpartition("/")[2] == "campaign":
                yield [word for word in words[1:] if "..." not in word]


@pytest.mark.parametrize("page", PAGES)
def test_links_and_pictures_lead_somewhere(page):
    text = re.sub(r"```.*?```", "", PAGES[page].read_text("utf-8"), flags=re.S)
    for target in re.findall(r"\]\(([^)#\s]+)(?:#[^)]*)?\)", text):
        made = target in ("reference/keys.md", "reference/command_line.md")
        assert made or "://" in target or (PAGES[page].parent / target).exists(), f"{page}: {target}"


@pytest.mark.parametrize("page", PAGES)
def test_commands_are_those_of_the_parser(page, capsys):
    for words in commands(page):
        words = words[: words.index(">")] if ">" in words else words
        if "--help" in words:
            continue
        try:
            parser().parse_args(words)
        except SystemExit:
            pytest.fail(f"{page}: campaign {shlex.join(words)}: {capsys.readouterr().err}")


def test_every_page_stands_in_the_index():
    index = (PROJECT / "docs" / "index.md").read_text("utf-8")
    patterns = [line.removesuffix("*") for line in index.splitlines() if re.fullmatch(r"[\w/-]+\*?", line)]
    for name in PAGES:
        stem = Path(name).stem
        if name != "README.md" and stem != "index":
            assert any(stem == pattern or (pattern and stem.startswith(pattern)) for pattern in patterns), name


@pytest.mark.slow
@pytest.mark.parametrize("page", MARKED)
def test_what_is_marked_runs(page, tmp_path):
    """In a folder of its own, in the page's order; the files that a mark names are the blocks before it."""
    (tmp_path / "bin").mkdir()
    tool = tmp_path / "bin" / "campaign"
    tool.write_text(f'#!/bin/sh\nexec {sys.executable} -m conespot "$@"\n')
    tool.chmod(0o755)
    environment = {**os.environ, "PATH": f"{tool.parent}:{os.environ['PATH']}", "CONESPOT_TRACEBACK": "1"}
    work = tmp_path / "work"
    work.mkdir()
    found = blocks(page)
    for number, block in enumerate(found):
        if not block[0].startswith(_MARK):
            continue
        names = (block["files"] or "").split()
        written = [b for b in found[:number] if b["kind"] in ("text", "yaml")]
        for name, file in zip(names, written[len(written) - len(names) :], strict=True):
            (work / name).write_text(file["text"])
        shell = ["bash", "-euo", "pipefail", "-c"] if block["kind"] == "sh" else [sys.executable, "-c"]
        done = subprocess.run([*shell, block["text"]], cwd=work, env=environment, capture_output=True, text=True)
        assert done.returncode == 0, f"{block['text']}{done.stdout[-1500:]}{done.stderr[-1500:]}"
