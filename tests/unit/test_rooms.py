"""The house: which room may import which, and how large a file may grow."""

import ast
from pathlib import Path

import pytest

import conespot

HOUSE = Path(conespot.__file__).parent
PROJECT = Path(__file__).parents[2]
#: what a room may import of the others
ROOMS = {
    "scene": set(),
    "render": {"scene"},
    "localize": {"scene"},
    "results": {"scene"},
    "campaigns": {"scene", "render", "localize", "results"},
}
#: what a room of `localize` may import of `localize`: its own, the leaves that anybody may, and these
LEAVES = {"outcome", "image"}
INNER_ROOMS = {
    "published": set(),
    "model": set(),
    "start": {"model"},
    "edge": {"model"},
    "field": {"model"},
    # begins where a start would, on rings
    "disc": {"model", "start"},
    # takes the albedo out as the field's fit does, and is a start as well
    "spot": {"model", "field", "start"},
    "theory": {"model"},
    "frames": set(),
    # follows with the fits of the localizers, and searches as they do
    "tracking": {"model", "edge", "cone", "photometric", "locate", "distance", "doubt", "verdict"},
}


def sources(*parts: str) -> list[Path]:
    return sorted(HOUSE.joinpath(*parts).rglob("*.py"))


def imports(path: Path) -> list[str]:
    """The modules of conespot that a file imports, as dotted names below `conespot.`."""
    found = []
    for node in ast.walk(ast.parse(path.read_text("utf-8"))):
        if isinstance(node, ast.Import):
            found += [alias.name for alias in node.names]
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, f"{path}: relative imports hide which room is meant"
            found += [f"{node.module}.{alias.name}" for alias in node.names]
    return [name.removeprefix("conespot.") for name in found if name.split(".")[0] == "conespot"]


@pytest.mark.parametrize("room", ROOMS)
def test_a_room_imports_only_the_rooms_its_arrows_lead_to(room):
    allowed = ROOMS[room] | {room}
    assert sources(room)
    for path in sources(room):
        strangers = {name.split(".")[0] for name in imports(path)} - allowed
        assert not strangers, f"{path.relative_to(HOUSE)} imports {', '.join(sorted(strangers))}"


@pytest.mark.parametrize("room", INNER_ROOMS)
def test_a_room_of_localize_imports_only_the_rooms_its_arrows_lead_to(room):
    allowed = INNER_ROOMS[room] | LEAVES | {room}
    assert sources("localize", room)
    for path in sources("localize", room):
        inner = {name.split(".")[1] for name in imports(path) if name.startswith("localize.")}
        assert not inner - allowed, f"{path.relative_to(HOUSE)} imports {', '.join(sorted(inner - allowed))}"


def test_every_folder_of_localize_is_a_room_with_arrows():
    folders = {path.parent.name for path in (HOUSE / "localize").glob("*/__init__.py")}
    assert folders == set(INNER_ROOMS)


def test_the_leaves_of_localize_import_nothing_of_it_but_each_other():
    for leaf in LEAVES:
        inner = {name.split(".")[1] for name in imports(HOUSE / "localize" / f"{leaf}.py") if "localize" in name}
        assert inner <= LEAVES


def test_no_file_is_longer_than_300_lines():
    files = [*PROJECT.glob("*/*.py"), *PROJECT.glob("*/*/*.py"), *PROJECT.glob("*/*/*/*.py")]
    own = [path for path in files if not path.relative_to(PROJECT).parts[0].startswith((".", "build"))]
    assert len(own) > 200
    long = {str(path.relative_to(PROJECT)): n for path in own if (n := len(path.read_text("utf-8").splitlines())) > 300}
    assert not long
