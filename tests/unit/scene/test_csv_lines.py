"""CSV files of any spreadsheet are read as they were meant, or refused in one sentence; never half understood."""

import pytest

from conespot.scene import InputError, load_scene
from conespot.scene.document import read_document
from conespot.scene.trajectory import AnyTrajectory

PLAIN = "x_mm,y_mm,z_mm\n0.5,0,4\n1,-1.25,4\n"
POSITIONS = ((0.5, 0.0, 4.0), (1.0, -1.25, 4.0))
DIALECTS = {
    "plain": PLAIN.encode(),
    "byte-order mark": b"\xef\xbb\xbf" + PLAIN.encode(),
    "CRLF": PLAIN.replace("\n", "\r\n").encode(),
    "CR alone": PLAIN.replace("\n", "\r").encode(),
    "no end of line": PLAIN.rstrip().encode(),
    "UTF-16": PLAIN.encode("utf-16"),
    "UTF-16 big-endian with tabs": "\ufeff".encode("utf-16-be") + PLAIN.replace(",", "\t").encode("utf-16-be"),
    "quoted": b'"x_mm","y_mm","z_mm"\n"0.5","0","4"\n"1","-1.25","4"\n',
    "blanks": b" x_mm , y_mm , z_mm \n 0.5 , 0 , 4 \n 1 , -1.25 , 4 \n",
    "semicolons": PLAIN.replace(",", ";").encode(),
    "decimal commas": PLAIN.replace(",", ";").replace(".", ",").encode(),
    "decimal commas, quoted": b'x_mm;y_mm;z_mm\n"0,5";"0";"4"\n"1";"-1,25";"4"\n',
    "tabs and decimal commas": PLAIN.replace(",", "\t").replace(".", ",").encode(),
    "Excel's first line": b"sep=;\r\n" + PLAIN.replace(",", ";").replace(".", ",").encode(),
    "comments and blank lines": b"# of Monday\n\n" + PLAIN.replace("\n", "\n\n# next\n").encode(),
    "empty cells at the end": PLAIN.replace("\n", ",,\n").encode(),
    "other order and columns": b"name,z_mm,y_mm,x_mm\na,4,0,0.5\nb,4,-1.25,1\n",
    "exponents": b"x_mm,y_mm,z_mm\n5e-1,0,4.\n+1,-125E-2,4\n",
}


@pytest.fixture
def trajectory(tmp_path):
    def read(content):
        (tmp_path / "t.csv").write_bytes(content)
        (tmp_path / "x.yaml").write_text("trajectory: {kind: csv, file: t.csv}")
        return read_document(tmp_path / "x.yaml").validate(AnyTrajectory, at=("trajectory",))

    return read


@pytest.mark.parametrize("dialect", DIALECTS)
def test_every_dialect_of_a_trajectory_gives_the_same_positions(trajectory, dialect):
    assert trajectory(DIALECTS[dialect]).points == POSITIONS


@pytest.mark.parametrize(
    ("content", "says"),
    [
        (b"x_mm,y_mm,z_mm,x_mm\n0,0,4,3\n", "t.csv:1: the column x_mm stands twice"),
        (b'"x_mm",y_mm,z_mm, x_mm \n0,0,4,3\n', "t.csv:1: the column x_mm stands twice"),
        (b"x_mm,y_mm,z_mm,a,a\n0,0,4,3,3\n", "t.csv:1: the column a stands twice"),
        (b"x_mm,y_mm,z_mm\n0,5,0,4,0\n", "t.csv:2: 5 cells below a header of 3; with commas as decimal signs"),
        (b"x_mm;y_mm;z_mm\n0,5;1.5;4\n", "t.csv:2: .*decimal points and decimal commas are mixed"),
        (b"x_mm;y_mm;z_mm\n1.234,5;0;4\n", "t.csv:2: .*is no number"),
        (b'x_mm,y_mm,z_mm\n"1,234",0,4\n', "t.csv:2: .*'1,234' is no number"),
        (b"x_mm,y_mm,z_mm\n1_0,0,4\n", "t.csv:2: .*'1_0' is no number"),
        ("x_mm,y_mm,z_mm\n١,0,4\n".encode(), "t.csv:2: .*is no number"),
        (b"x_mm,y_mm,z_mm\n0,4\n", "t.csv:2: .*a cell is empty"),
        (b"x_mm,y_mm,z_mm\n0,,4\n", "t.csv:2: .*a cell is empty"),
        (b"x_mm,y_mm,z_mm\n0,inf,4\n", "t.csv:2: .*finite"),
        (b"x_mm,y_mm,z_mm\n0,1e999,4\n", "t.csv:2: .*finite"),
        (b'x_mm,y_mm,z_mm\n"0,1,4\n', "t.csv:2: cannot be read as CSV"),
        (b"x_mm,y_mm,z_mm\n0,\x00,4\n", "t.csv: cannot be read as CSV: holds NUL characters"),
        (b"# H\xf6he\nx_mm,y_mm,z_mm\n", "t.csv:1: is no text in UTF-8 .*; save the list of positions as UTF-8"),
        (PLAIN.encode("utf-16")[:-1], "t.csv:.*: is no text in UTF-8"),
        (PLAIN.encode("utf-32"), "t.csv: "),
        (b"", "t.csv:1: no column x_mm, y_mm, z_mm"),
        (b"X_MM,y_mm,z_mm\n", "t.csv:1: no column x_mm"),
        (b"x_mm,y_mm,z_mm\n" + b"0,0,4\n" * 100_001, "t.csv:100002: more than 100000 positions"),
    ],
)
def test_what_cannot_be_meant_is_refused_with_its_line(trajectory, content, says):
    with pytest.raises(InputError, match=says) as error:
        trajectory(content)
    assert "\n" not in str(error.value)


@pytest.mark.parametrize(
    "content",
    [
        b"\xef\xbb\xbf500,0.5\r\n550,7\r\n600,0\r\n",
        b"nm;power\n500;0,5\n550;7\n600;0\n",
        '"nm","power"\r\n"500","0.5"\r\n"550","7"\r\n"600","0"\r\n'.encode("utf-16"),
        b"wavelength (nm; air),power\n500,0.5\n550,7\n600,0\n",
    ],
)
def test_every_dialect_of_a_spectrum_gives_the_same_light(tmp_path, content):
    (tmp_path / "lamp.csv").write_bytes(content)
    (tmp_path / "x.yaml").write_text("illumination: {kind: csv, file: lamp.csv}")
    light = load_scene(tmp_path / "x.yaml").illumination
    assert light.points == ((500.0, 0.5), (550.0, 7.0), (600.0, 0.0))


def test_decimal_commas_between_commas_are_no_spectrum(tmp_path):
    (tmp_path / "lamp.csv").write_text("nm,power\n500,0,5,0\n550,0,7,0\n")
    (tmp_path / "x.yaml").write_text("illumination: {kind: csv, file: lamp.csv}")
    with pytest.raises(InputError, match=r"lamp.csv:2: 4 cells below a header of 2"):
        load_scene(tmp_path / "x.yaml")


def test_a_height_map_of_decimal_commas_is_that_of_decimal_points(tmp_path):
    text = "0.5,1,2,3\n" * 4
    maps = []
    for name, content in {"a": text, "b": text.replace(",", ";").replace(".", ",")}.items():
        (tmp_path / f"{name}.csv").write_text(content)
        (tmp_path / "x.yaml").write_text(f"surface: {{height_map: {{kind: csv, file: {name}.csv, width: 2 mm}}}}")
        maps.append(load_scene(tmp_path / "x.yaml").surface.height_map.points)
    assert maps[0] == maps[1] == ((0.5, 1.0, 2.0, 3.0),) * 4
