"""results.cases: what a run says of its cases is hostile until validated, and need not be there."""

import json

import pytest

from conespot.results import cases as cases_module
from conespot.results.run import load_run
from conespot.scene import InputError


@pytest.fixture
def frame(make_rows):
    return make_rows(poses=2, powers=(0.25, 1.0), trajectories=("box",))


@pytest.fixture
def refused(tmp_path, frame, make_run):
    def check(text):
        folder = make_run(tmp_path / "run", frame)
        (folder / "cases.jsonl").write_bytes(text if isinstance(text, bytes) else text.encode())
        with pytest.raises(InputError) as caught:
            load_run(folder)
        message = str(caught.value)
        assert message.isprintable()
        assert len(message) < 600
        assert f"{folder / 'cases.jsonl'}" in message
        return message

    return check


def test_every_case_is_read_with_its_words_watts_and_scene(tmp_path, frame, make_run):
    run = load_run(str(make_run(tmp_path / "run", frame)))
    assert set(run.cases) == set(frame["case"])
    case = run.cases[frame["case"].iloc[0]]
    assert case.labels["power_w"] == 0.25
    assert case.watts.flux_w == pytest.approx(0.25 * 3.0779e-3, rel=1e-4)
    assert case.assumes.edge.startswith("Cycles blend 1")
    assert case.scene["eye"]["radius"] == "12.5 mm"
    assert (case.version, case.poses) == (1, 2)


def test_a_run_without_the_file_has_no_cases(tmp_path, frame, make_run):
    assert load_run(make_run(tmp_path / "run", frame, described=[])).cases == {}


def test_keys_of_a_later_version_are_left_alone(tmp_path, frame, make_run, make_cases):
    described = [{**case, "schema": 7, "novelty": [1, 2]} for case in make_cases(frame)]
    assert len(load_run(make_run(tmp_path / "run", frame, described=described)).cases) == len(described)


def test_labels_tell_which_columns_without_a_dot_are_swept(tmp_path, make_rows, make_run):
    frame = make_rows(poses=2, powers=(1.0,), swept={"seed": (1, 2)})
    assert load_run(make_run(tmp_path / "run", frame)).rows.swept == ("seed",)


@pytest.mark.parametrize(
    ("path", "value", "said"),
    [
        (("schema",), None, "schema"),
        (("schema",), "one", "schema"),
        (("key",), "../../etc/passwd", "key"),
        (("frame",), 7, "frame"),
        (("assumes", "edge"), "hard\x1b[31m", "assumes.edge: must hold printable characters alone"),
        (("assumes", "edge"), "x" * 10_000, "assumes.edge"),
        (("assumes", "surface"), None, "assumes.surface"),
        (("assumes",), "not stated", "assumes"),
        (("watts", "flux_w"), -1.0, "watts: must hold finite numbers that are not negative"),
        (("watts", "flux_w"), float("nan"), "watts: must hold finite numbers"),
        (("watts", "isotropic_w"), "1 W", "watts.isotropic_w"),
        (("localizers", "x" * 300), {"threshold": "a", "ambiguity": "b"}, "localizers"),
        (("localizers", "mine"), {"threshold": "a"}, "localizers.mine.ambiguity"),
        (("labels", "surface"), ["smooth"], "labels.surface"),
        (("poses",), -1, "poses"),
        (("scene",), "paper-code", "scene"),
    ],
)
def test_a_wrong_value_is_one_clear_sentence_with_its_line(frame, make_cases, refused, path, value, said):
    first, second, *_ = make_cases(frame)
    here = second
    for key in path[:-1]:
        here = here[key]
    here[path[-1]] = value
    lines = [json.dumps(case, default=lambda number: number.item()) for case in (first, second)]
    message = refused("\n".join(lines) + "\n")
    assert "cases.jsonl:2: is no case: " in message
    assert said in message


@pytest.mark.parametrize("text", ["{", "[]", "7", "\n", b"\xff\xfe\x00", "[" * 100_000, '{"schema": "\\ud800"}'])
def test_garbage_is_refused(refused, text):
    assert "cases.jsonl:1: is no case" in refused(text)


def test_a_case_that_stands_twice_is_refused(frame, make_cases, refused):
    line = json.dumps(make_cases(frame)[0], default=lambda number: number.item())
    assert "stands twice" in refused(f"{line}\n{line}\n")


@pytest.mark.parametrize(
    ("bound", "said"), [("_MAX_BYTES", "larger than"), ("_MAX_LINE", "longer than"), ("_MAX_CASES", "more than")]
)
def test_what_is_too_large_is_refused(frame, make_cases, refused, monkeypatch, bound, said):
    monkeypatch.setattr(cases_module, bound, 1)
    lines = [json.dumps(case, default=lambda number: number.item()) for case in make_cases(frame)]
    assert said in refused("\n".join(lines))


def test_a_folder_in_the_files_place_is_one_clear_sentence(tmp_path, frame, make_run):
    folder = make_run(tmp_path / "run", frame, described=[])
    (folder / "cases.jsonl").mkdir()
    with pytest.raises(InputError, match=r"cases\.jsonl: cannot be read"):
        load_run(folder)
