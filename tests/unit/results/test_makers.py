"""The report says who made the rows, and refuses what says nothing."""

import json

import pytest

from conespot.results import write_results
from conespot.results.makers import FILE, maker_block, read_makers
from conespot.scene import InputError


@pytest.fixture
def folder(tmp_path, make_run, make_rows):
    return make_run(tmp_path / "run", make_rows(poses=3, trajectories=("box",), rigs=("single",), powers=(1.0,)))


def test_every_maker_stands_in_the_report_with_its_poses(folder):
    (folder / FILE).write_text(json.dumps({"variant scalar_rgb, conespot 1": 2, "variant <b>": 1}))
    write_results(folder)
    report = (folder / "report.html").read_text()
    assert "variant scalar_rgb, conespot 1" in report
    assert "variant &lt;b&gt;" in report
    assert maker_block(read_makers(folder)).lines == (("2", "variant scalar_rgb, conespot 1"), ("1", "variant <b>"))


@pytest.mark.parametrize("content", ["", "[]", '{"a": "b"}', '{"a": -1}', '{"a": 1.5}', '{"%s": 1}' % ("a" * 501)])
def test_what_names_no_makers_is_refused_in_a_sentence(folder, content):
    (folder / FILE).write_text(content)
    with pytest.raises(InputError, match=r"makers\.json: does not say how many poses each maker finished"):
        read_makers(folder)


def test_a_run_that_does_not_say_has_no_makers(folder):
    assert read_makers(folder) == {}
    assert maker_block({}) is None
