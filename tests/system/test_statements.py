"""What a report says its numbers assume, for the example of docs/campaigns.md and every shipped campaign, case by case.

The campaigns are planned, described and written as run folders with one pose a case and answers that are made up;
nothing is rendered. Against convention, edge and surface of the scenes that the plan would render.
"""

import itertools
import math
import re
from pathlib import Path

import pandas as pd
import pytest

from conespot.campaigns.cases import write_cases
from conespot.campaigns.plan import make_plan
from conespot.campaigns.row import Finding, Record, Stated
from conespot.campaigns.row_table import row_table
from conespot.campaigns.schema import makes_frames, override, read_campaign, resolved
from conespot.results.boxes import box_table
from conespot.results.check import check, expected
from conespot.results.columns import COLUMNS, SETTING
from conespot.results.expectation import ANY
from conespot.results.figures import plan_figures
from conespot.results.paper_values import BOTH
from conespot.results.run import load_run
from conespot.results.tables import make_tables
from conespot.scene.document import dump, shipped

PAGE = Path(__file__).parents[2] / "docs" / "campaigns.md"
CAMPAIGNS = [name for name in sorted(shipped("campaigns", "")) if makes_frames(read_campaign(name))]
EDGES = {"hard": "hard", "cycles": "Cycles blend", "linear": "linear", "table": "tabulated"}


def example():
    (text,) = re.findall(r"```yaml\n(name: half_angles\n.*?)```", PAGE.read_text(), re.S)
    return text


def answered(group, pose):
    """A record in which every localizer is off by 4 um; the estimators say so."""
    truth = group.pose(pose)
    findings = []
    for case in group.cases:
        for name in case.localizers:
            stated = {"covariance": [[1e-5 * (i == j) for j in range(5)] for i in range(5)]} if name == "cone" else {}
            apex = tuple(float(v) for v in truth.apex + [0.0, 0.0, 0.004])
            findings.append(Finding(case=case.key, localizer=name, apex=apex, axis=tuple(truth.axis), **stated))
    return Record(unit=group.unit(pose), findings=tuple(findings))


#: those that are told apart by what no other is: the others are read where there is more time
QUICK = ("deformation", "power_sweep")
EACH = [pytest.param(name, marks=() if name in QUICK else pytest.mark.slow) for name in CAMPAIGNS]


@pytest.fixture(scope="module", params=["the page", *EACH])
def written(request, tmp_path_factory):
    """The plan of a campaign, its run, and the boxes of that."""
    folder = tmp_path_factory.mktemp("run")
    name = request.param
    if name == "the page":
        (folder / "half_angles.yaml").write_text(example())
        name = str(folder / "half_angles.yaml")
    document = override(read_campaign(name), "poses", "1", "--poses")
    plan = make_plan(document)
    records = {group.unit(0): answered(group, 0) for group in plan.groups}
    (folder / "campaign.yaml").write_text(dump(resolved(document, {})))
    write_cases(folder, plan)
    stated = Stated.among(f for record in records.values() for f in record.findings)
    row_table(plan, records, records.__getitem__, stated).to_parquet(folder / "errors.parquet", index=False)
    run = load_run(folder)
    return plan, run, box_table(run.rows)


def rightly(case, convention, edge, surface):
    """Whether words tell a case's own convention, edge and surface."""
    scene = case.scene
    angle = f"half angle {math.degrees(scene.beam.half_angle):.6g} deg"
    if scene.beam.source_diameter:
        angle += f", core {scene.beam.source_diameter:g} mm"
    relief = {"bumps": len(scene.surface.bumps) > 0, "ellipsoid": len(set(scene.surface.semi_axes)) > 1}
    return (
        convention.startswith(scene.power.convention)
        and edge.startswith(EDGES[scene.beam.kind])
        and edge.endswith(angle)
        and (scene.beam.kind != "cycles" or f"blend {scene.beam.blend:g}" in edge)
        and (surface == "smooth") == (scene.surface.relief == 0.0 and not relief["ellipsoid"])
        and all((word in surface) == there for word, there in relief.items() if surface != "smooth")
    )


def of(run, plan, table):
    """Every line of a table with the cases it is about."""
    data = table.frame
    if table.name == "expectations":
        for line, where in zip(data.to_dict("records"), judged(run), strict=True):
            yield line, [case for case in plan.cases if meant(where, {**case.labels, **case.swept})]
        return
    keys = [name for name in data.columns if name in SETTING or "." in name or name in plan.cases[0].swept]
    for line in data.to_dict("records"):
        wanted = {key: line[key] for key in keys if not (key == "trajectory" and line[key] == BOTH)}
        wanted.pop("localizer")
        labels = [(case, {**case.labels, **case.swept}) for case in plan.cases]
        found = [case for case, own in labels if all(own[key] == value for key, value in wanted.items())]
        assert found, wanted
        yield line, found


def said(table, line):
    """Convention, edge and surface of a line; an expectation may pool cases that differ, and names each one's."""
    words = [line[name] for name in ("power_convention", "edge", "surface_shape")]
    return itertools.product(*(w.split(" or ") if table.name == "expectations" else [w] for w in words))


def stated(block):
    """All that a block says its numbers assume, in its notes or, with what others assume alike, in its table's."""
    return " ".join([*block.notes, block.assumes.sentence() if block.assumes is not None else ""])


def judged(run):
    """What the lines are called that each expectation is about which the run can be judged by, beside the localizer."""
    verdicts = check(run, expected(run.document))
    return [{k: v for k, v in one.expectation.where.items() if k != "localizer"} for one in verdicts if not one.unclear]


def meant(where, labels):
    """Whether labels are those that an expectation names."""
    wanted = {name: value if isinstance(value, tuple) else (value,) for name, value in where.items()}
    return all(ANY in value or labels[name] in value for name, value in wanted.items())


def test_every_number_of_every_table_states_its_own_convention_edge_and_surface(written):
    plan, run, boxes = written
    tables = make_tables(run, boxes)
    seen = set()
    for table in tables:
        if table.name == "table_1":
            continue
        for line, cases in of(run, plan, table):
            assert cases, (table.name, line)
            for case in cases:
                seen.add(case.key)
                assert any(rightly(case, *words) for words in said(table, line)), (table.name, line)
    assert seen == {case.key for case in plan.cases}


def test_every_block_names_what_each_of_its_cases_assumes(written):
    plan, run, boxes = written
    tables = [table for table in make_tables(run, boxes) if table.name != "table_1"]
    for table in tables:
        assert all("power convention: " in stated(block) for block in table.blocks)
        # what all blocks assume alike is written once
        assert all(f"{words}" in " ".join(table.text().split()) for words in table.shared.values())
        assert "not stated" not in table.text()
    said = [stated(block) for table in tables for block in table.blocks]
    for scene in (case.scene for case in plan.cases):
        words = (scene.power.words, scene.beam.words, scene.surface.words, scene.sensor.words)
        assert any(all(word in note for word in words) for note in said), words


def test_every_figure_states_its_own_convention_edge_and_surface(written):
    plan, run, boxes = written
    drawings, _ = plan_figures(run, boxes)
    assert drawings
    cases = {case.key: case for case in plan.cases}
    for drawing in drawings:
        said = dict(re.findall(r"(edge|power convention|surface shape): (.*?)(?:;|$)", drawing.caption))
        for key in drawing.cut.rows["case"].unique():
            words = said["power convention"], said["edge"], said["surface shape"]
            # a figure of all rows pools cases that differ, and names each one's
            each = itertools.product(*(word.split(" or ") if drawing.kind.of_run else [word] for word in words))
            assert any(rightly(cases[key], *words) for words in each), drawing.caption
        assert "(convention not stated)" not in drawing.caption


def test_rows_have_the_declared_columns_in_their_order_and_name_their_frame(written):
    plan, run, _ = written
    stored = pd.read_parquet(run.folder / "errors.parquet")
    declared = [column.name for column in COLUMNS if column.name in stored.columns]
    assert list(stored.columns) == [*declared, *plan.cases[0].swept]
    assert {column.name for column in COLUMNS if not column.optional} <= set(stored.columns)
    frames = {case.key: case.frame for case in plan.cases}
    assert (stored["case"].map(frames) == stored["frame"]).all()
