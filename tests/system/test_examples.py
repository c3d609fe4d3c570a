"""The examples in the help of every command, run in their order as a shell runs them."""

import itertools
import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from conespot.campaigns.command import main
from conespot.campaigns.command_line import parser
from conespot.campaigns.examples import EXAMPLES
from conespot.results import writing
from conespot.results.figures import plan_figures

#: commands whose examples take seconds
QUICK = ("list", "show", "explain", "schema", "completion", "init", "validate")


def commands():
    (sub,) = (action for action in parser()._actions if action.choices)
    return sub.choices


@pytest.fixture
def shell(tmp_path):
    """Runs a line with this project's `campaign`, in a folder of its own."""
    (tmp_path / "bin").mkdir()
    tool = tmp_path / "bin" / "campaign"
    tool.write_text(f'#!/bin/sh\nexec {sys.executable} -m conespot "$@"\n')
    tool.chmod(0o755)
    environment = {**os.environ, "PATH": f"{tool.parent}:{os.environ['PATH']}"}
    (tmp_path / "work").mkdir()

    def run(line, program="bash"):
        return subprocess.run(
            [program, "-c", line], cwd=tmp_path / "work", env=environment, capture_output=True, text=True, timeout=300
        )

    return run


def test_every_command_has_an_example_in_its_help():
    assert set(EXAMPLES) == set(commands())
    for name, command in commands().items():
        for line in EXAMPLES[name]:
            assert line in command.format_help()
            assert any(f"campaign {name}" in other for other in EXAMPLES[name])


def campaign(line):
    """The line's command in this process, which starts sooner; of what a shell makes of it, all but redirections."""
    said = subprocess.run(["bash", "-c", f"printf '%s\\0' {line.partition(' > ')[0]}"], capture_output=True, check=True)
    return main(said.stdout.decode().split("\0")[1:-1])


def test_examples_that_render_nothing_work(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    for name in QUICK:
        for line in EXAMPLES[name]:
            assert campaign(line) == 0, f"{line}: {capsys.readouterr().err}"


@pytest.mark.slow
def test_every_example_works_after_those_before_it(shell, tmp_path, monkeypatch, capsys):
    """On one core, as other tests have the others; of each run's figures the first is drawn."""
    monkeypatch.chdir(tmp_path / "work")
    monkeypatch.setattr(writing, "plan_figures", lambda run, boxes: (plan_figures(run, boxes)[0][:1], 0))
    monkeypatch.setattr(os, "sched_getaffinity", lambda _: {0}, raising=False)
    for line in itertools.chain.from_iterable(EXAMPLES.values()):
        code = campaign(line) if line.startswith("campaign ") else shell(line).returncode
        assert code == 0, f"{line}: {capsys.readouterr().err[-1000:]}"


def test_bash_completes_commands_options_and_shipped_campaigns(shell):
    assert shell("campaign completion bash > conespot.bash").returncode == 0
    for words, wanted in (
        ("pre", "preview"),
        ("run --po", "--poses"),
        ("plan power", "power_sweep"),
        ("theory theatre-i", "theatre-ideal"),
    ):
        line = (
            f"source conespot.bash; COMP_WORDS=(campaign {words}); COMP_CWORD=$((${{#COMP_WORDS[@]}} - 1));"
            '_shtab_campaign campaign "${COMP_WORDS[COMP_CWORD]}"; printf "%s\\n" "${COMPREPLY[@]}"'
        )
        assert wanted in shell(line).stdout.split()


def test_zsh_reads_its_script(shell):
    done = shell("campaign completion zsh > _campaign && head -1 _campaign")
    assert done.stdout.startswith("#compdef campaign")
    if shutil.which("zsh"):
        assert shell("zsh -n _campaign").returncode == 0


def test_the_order_of_examples_is_one_that_works():
    made = {"mine.yaml": "init", "runs/mine": "run", "runs/mine.zip": "pack"}
    order = list(EXAMPLES)
    for what, maker in made.items():
        users = [name for name, lines in EXAMPLES.items() if any(f" {what}" in line for line in lines)]
        assert all(order.index(maker) <= order.index(user) for user in users)
    assert not Path("mine.yaml").exists()
