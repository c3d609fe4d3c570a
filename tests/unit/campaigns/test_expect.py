"""`expect:` in a campaign: it changes no row, the shipped ones hold the paper's numbers, and `check` judges by it."""

import pytest

from conespot.campaigns.command import main
from conespot.campaigns.plan import make_plan
from conespot.campaigns.schema import base, override, read_campaign
from conespot.results.paper_values import paper_errors, paper_table_1, paper_value
from conespot.scene import InputError
from conespot.scene.document import shipped

CARRYING = ["deformation", "power_sweep", "reproduce_ci", "theory", "trajectories", "white"]
EXPECT = "expect:\n  - {metric: Table I um, where: {half_angle_deg: 9}, value: 0.49, within: 0.02, source: Table I}\n"


def shipped_expectations():
    for name in shipped("campaigns", ""):
        for expectation in base(read_campaign(name)).expect:
            yield name, expectation


def test_these_campaigns_say_what_must_come_out():
    assert sorted({name for name, _ in shipped_expectations()}) == CARRYING


def test_what_they_expect_of_the_papers_tables_is_what_the_paper_prints():
    known = {source.source for source in paper_errors()}
    looked_at = 0
    for name, e in shipped_expectations():
        if e.source == "Table I":
            assert e.value == paper_table_1()[e.where["half_angle_deg"]], name
        elif e.source in known:
            quantity, unit = e.metric.split()
            metric = {"mm": "position_error_mm", "deg": "rotation_error_deg"}[unit]
            trajectory = e.where.get("trajectory", "helix")
            place = "box and helix" if isinstance(trajectory, tuple) else trajectory
            assert e.value == paper_value(e.source, place, e.where.get("spotlights", "single"), quantity, metric), name
            assert (e.source == "Table V") == (e.where.get("surface") == "bumps")
        else:
            continue
        looked_at += 1
    assert looked_at > 80


@pytest.mark.parametrize("name", ["reproduce_ci", "theory"])
def test_what_is_expected_names_no_case_and_no_run_anew(name):
    document = read_campaign(name)
    with_, without = make_plan(document), make_plan(override(document, "expect", "[]", "--set expect"))
    assert with_.identity == without.identity
    assert [case.key for case in with_.cases] == [case.key for case in without.cases]


def test_a_wrong_expectation_is_named_by_its_line(tmp_path):
    file = tmp_path / "mine.yaml"
    file.write_text("name: mine\ntheory: [table-1]\n" + EXPECT.replace("Table I um", "Table J um"))
    with pytest.raises(InputError, match=r"mine.yaml:4: expect.0.metric: unknown metric .* did you mean 'Table I um'"):
        base(read_campaign(str(file)))


@pytest.fixture(scope="module")
def run(tmp_path_factory):
    """A run of the theory whose campaign expects one number."""
    folder = tmp_path_factory.mktemp("expect")
    (folder / "mine.yaml").write_text("name: mine\ntheory: [table-1]\n" + EXPECT)
    assert main(["run", str(folder / "mine.yaml"), "--out", str(folder / "run")]) == 0
    return folder / "run"


def test_check_judges_by_what_the_runs_own_campaign_expects(run, capsys, tmp_path):
    files = tmp_path / "verdicts.xml", tmp_path / "verdicts.md"
    assert main(["check", str(run), "--junit", str(files[0]), "--markdown", str(files[1])]) == 0
    assert "1 of 1 hold" in capsys.readouterr().out
    assert 'tests="1" failures="0" errors="0"' in files[0].read_text()
    assert "| Table I | Table I um | half\\_angle\\_deg 9 | 0.49 ± 0.02 |" in files[1].read_text()


def test_check_judges_by_another_campaign_and_fails_for_a_miss(run, capsys, tmp_path):
    other = tmp_path / "other.yaml"
    other.write_text("theory: [table-1]\n" + EXPECT.replace("0.49", "0.4"))
    assert main(["check", str(run), "--campaign", "theory"]) == 0
    assert main(["check", str(run), "--campaign", str(other)]) == 1
    said = capsys.readouterr()
    assert "MISSES" in said.out
    assert "1 expectations missed" in said.err


def test_check_prints_what_it_judged_beside_what_it_cannot(run, capsys, tmp_path):
    other = tmp_path / "other.yaml"
    missed, unclear = EXPECT.replace("0.49", "0.4"), EXPECT.replace("9}", "8}").split("\n", 1)[1]
    other.write_text("theory: [table-1]\n" + missed + unclear)
    assert main(["check", str(run), "--campaign", str(other)]) == 2
    said = capsys.readouterr()
    assert "MISSES" in said.out
    assert "1 expectations missed" in said.err
    assert "no line with 8" in said.err


def test_check_refuses_what_cannot_be_judged_and_where_nothing_is_expected(run, capsys, tmp_path):
    other = tmp_path / "other.yaml"
    other.write_text("theory: [table-1]\n" + EXPECT.replace("9}", "8}"))
    junit = tmp_path / "verdicts.xml"
    assert main(["check", str(run), "--campaign", str(other), "--junit", str(junit)]) == 2
    assert "other.yaml:3: Table I um: half_angle_deg 8: where: no line with 8" in capsys.readouterr().err
    assert 'errors="1"' in junit.read_text()
    assert main(["check", str(run), "--campaign", "spiral"]) == 2
    assert "nothing is expected" in capsys.readouterr().err
    assert main(["check", str(tmp_path / "none")]) == 2
