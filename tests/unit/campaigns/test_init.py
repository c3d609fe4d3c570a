"""`campaign init`: what it writes is a campaign, whatever is answered, and it never writes over anything."""

import io

import pytest

from conespot.campaigns import questions
from conespot.campaigns.command import main
from conespot.campaigns.plan import make_plan
from conespot.campaigns.schema import read_campaign

EVERYTHING = {
    "preset": "theatre-ideal",
    "resolution": "640x360",
    "spotlights": "single,triple",
    "trajectory": "box,line",
    "poses": "3",
    "power": "0.1 mW, 0.2 mW",
    "light": "led-b3,ir850",
    "surface": "smooth,bumps",
    "localizers": "cone",
}


class Terminal(io.StringIO):
    def isatty(self):
        return True


@pytest.fixture(autouse=True)
def here(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)


def planned(name):
    return make_plan(read_campaign(name))


def test_without_options_or_a_terminal_it_writes_a_small_campaign_that_a_plan_takes(tmp_path, capsys):
    assert main(["init"]) == 0
    plan = planned("my_campaign.yaml")
    assert (len(plan.cases), plan.rows) == (1, 40)
    assert plan.campaign.name == "my_campaign"
    assert plan.cases[0].scene.camera.resolution == 1000
    assert "40 rows" in capsys.readouterr().out
    assert max(map(len, (tmp_path / "my_campaign.yaml").read_text().splitlines())) <= 120


def test_several_answers_are_swept_and_one_is_settled():
    options = [part for name, value in EVERYTHING.items() for part in (f"--{name}", value)]
    assert main(["init", "all of it.yaml", *options]) == 0
    plan = planned("all of it.yaml")
    assert plan.campaign.name == "all-of-it"
    assert len(plan.cases) == 2**5
    assert {case.scene.power.value for case in plan.cases} == {1e-4, 2e-4}
    assert {case.scene.camera.resolution for case in plan.cases} == {(640, 360)}
    assert plan.rows == 32 * 3


def test_what_is_proposed_beside_the_answers_can_be_taken_as_it_stands(tmp_path):
    assert main(["init", "a.yaml", "--poses", "2"]) == 0
    text = (tmp_path / "a.yaml").read_text()
    (tmp_path / "b.yaml").write_text(text.replace("sweep: {}", "sweep:").replace("\n#  ", "\n  "))
    assert len(planned("b.yaml").cases) == 3 * 2 * 2 * 2


@pytest.mark.parametrize(
    ("option", "answer", "said"),
    [
        ("--preset", "papper", "did you mean 'paper'?"),
        ("--light", "", "answer one of preset, white"),
        ("--power", "3", "expected a power such as '1 W'"),
        ("--power", "0 W", "above 0 W"),
        ("--poses", "-1", "from 1 to 100000"),
        ("--resolution", "big", "1920x1080"),
        ("--resolution", "1000x", "1920x1080"),
        ("--localizers", "cone,conee", "did you mean 'cone'?"),
    ],
)
def test_an_answer_that_is_none_is_one_sentence_and_writes_nothing(tmp_path, capsys, option, answer, said):
    assert main(["init", option, answer]) == 2
    error = capsys.readouterr().err
    assert error.startswith(f"campaign: {option}: ")
    assert said in error
    assert len(error.splitlines()) == 1
    assert list(tmp_path.iterdir()) == []


def test_a_file_that_is_there_is_left_alone(tmp_path, capsys):
    (tmp_path / "my_campaign.yaml").write_text("mine")
    assert main(["init"]) == 2
    assert (tmp_path / "my_campaign.yaml").read_text() == "mine"
    assert main(["init", "nowhere/a.yaml"]) == 2
    assert "nowhere: no such folder" in capsys.readouterr().err


def test_a_person_is_asked_until_it_is_understood_and_not_for_what_an_option_says(monkeypatch, capsys):
    said = Terminal()
    monkeypatch.setattr(questions.sys, "stdin", Terminal("\nfour\ntriple\n\n5\n" + "\n" * 5))
    monkeypatch.setattr(questions.sys, "stderr", said)
    assert main(["init", "--preset", "paper"]) == 0
    plan = planned("my_campaign.yaml")
    assert len(plan.cases[0].scene.spotlights) == 3
    assert plan.rows == 10
    assert "which experiment" not in said.getvalue()
    assert said.getvalue().count("how many cones") == 2
    assert "'four' is none of the answers" in said.getvalue()


def test_whoever_goes_away_leaves_nothing_behind(tmp_path, monkeypatch):
    monkeypatch.setattr(questions.sys, "stdin", Terminal("paper\n"))
    monkeypatch.setattr(questions.sys, "stderr", Terminal())
    assert main(["init"]) == 130
    assert list(tmp_path.iterdir()) == []
