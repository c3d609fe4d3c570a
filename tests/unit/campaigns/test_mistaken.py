"""A scene given for a campaign, a campaign for a run, a run for its archive: one sentence says so, and what to do."""

import zipfile

import pytest

from conespot.campaigns.command import main


@pytest.fixture
def work(tmp_path, monkeypatch):
    """A working folder with a scene, a campaign, a run of it, and an archive."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "eye.yaml").write_text("preset: paper\neye: {radius: 12 mm}\n")
    (tmp_path / "mine.yaml").write_text("scene: {preset: paper}\nposes: 2\n")
    (tmp_path / "runs" / "mine").mkdir(parents=True)
    (tmp_path / "runs" / "mine" / "campaign.yaml").write_text("scene: {eye: {radius: 12 mm}}\nposes: 2\n")
    with zipfile.ZipFile(tmp_path / "mine.zip", "w") as archive:
        archive.writestr("campaign.yaml", "")
    return tmp_path


@pytest.mark.parametrize(
    ("arguments", "says"),
    [
        (
            "theory reproduce_ci",
            "reproduce_ci: is a campaign, and `campaign theory` takes a scene; that one's begins with",
        ),
        (
            "localize a.png --scene mine.yaml",
            "mine.yaml: is a campaign, and `campaign localize` takes a scene; that one's",
        ),
        ("theory runs/mine", "is a run folder, and `campaign theory` takes a scene; what stands under `scene:`"),
        ("plan theatre", "theatre: is a scene, and `campaign plan` takes a campaign; `--set scene=theatre`"),
        ("run eye.yaml", "eye.yaml: is a scene, and `campaign run` takes a campaign; `--set scene=eye.yaml`"),
        (
            "preview runs/mine",
            "is a run folder, and `campaign preview` takes a campaign; that run's is runs/mine/campaign",
        ),
        ("plan mine.zip", "mine.zip: is an archive, and `campaign plan` takes a campaign; unpack it"),
        (
            "report mine.yaml",
            "mine.yaml: is a campaign, and `campaign report` takes a run folder; did you mean runs/mine?",
        ),
        (
            "status white",
            "white: is a campaign, and `campaign status` takes a run folder; `campaign run white` makes runs/wh",
        ),
        (
            "compare runs/mine mine.zip",
            "mine.zip: is an archive, and `campaign compare` takes a run folder; unpack it with",
        ),
        ("check paper", "paper: is a scene, and `campaign check` takes a run folder; such as runs/NAME"),
        (
            "verify runs/mine",
            "is a run folder, and `campaign verify` takes an archive; `campaign pack runs/mine` makes one",
        ),
    ],
)
def test_what_is_of_another_kind_is_named_with_its_mend(work, capsys, arguments, says):
    assert main(arguments.split()) == 2
    said = capsys.readouterr()
    assert says in said.err
    assert len(said.err.splitlines()) == 1
    assert said.out == ""


def test_what_is_of_the_right_kind_is_refused_for_what_is_wrong_with_it(work, capsys):
    (work / "mine.yaml").write_text("scene: {preset: paper}\nposes: 0\n")
    assert main(["plan", "mine.yaml"]) == 2
    assert "mine.yaml:2: poses" in capsys.readouterr().err


def test_a_preset_is_shown_as_a_campaign_is(capsys):
    assert main(["show", "theatre-ideal"]) == 0
    assert "kind: emva, chip: cmv12000-nir" in capsys.readouterr().out
