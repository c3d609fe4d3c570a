"""What a run folder gets: boxes.csv, tables/, figures/, report.html, each file whole or not there."""

from __future__ import annotations

from pathlib import Path

from conespot.results.boxes import box_table, encode_boxes, read_boxes
from conespot.results.figures import FIGURES, draw_figures, drawn_meanwhile, plan_figures
from conespot.results.report import make_report
from conespot.results.report.charts import pictures
from conespot.results.run import load_run
from conespot.results.tables import TABLE_NAMES, make_tables
from conespot.scene import InputError
from conespot.scene.atomic import write_atomically

_TEXT, _MARKDOWN = "tables.txt", "tables.md"
_FOLDERS = ("tables", "figures")


def write_results(run: str | Path) -> list[Path]:
    """Write box statistics, tables, figures and the report of a run folder; returns the files.

    Reads errors.parquet (or errors.csv), campaign.yaml, cases.jsonl and theory.csv, nothing else. Tables and figures
    of an earlier call that the rows no longer give are removed. Raises InputError for a folder that is no run, rows
    or cases that are not valid, and files that cannot be written.
    """
    run = Path(run)
    found = load_run(run)
    folders = {name: _folder(run / name) for name in _FOLDERS}
    written: list[Path] = []
    boxes = None
    if found.rows is not None:
        path = run / "boxes.csv"
        write_atomically(path, encode_boxes(box_table(found.rows)))
        written.append(path)
        boxes = read_boxes(path, found.rows)  # what follows rests on what is stored
    tables = make_tables(found, boxes)
    texts = {f"{table.name}.csv": table.frame.to_csv(index=False, float_format="%.9g") for table in tables}
    texts[_TEXT] = "\n\n".join(table.text() for table in tables)
    texts[_MARKDOWN] = "\n".join(table.markdown() for table in tables)
    for name, text in texts.items():
        write_atomically(folders["tables"] / name, text.encode())
        written.append(folders["tables"] / name)
    drawings, left_out = plan_figures(found, boxes)
    shown = pictures(drawings)  # on the page itself
    written += draw_figures(shown, folders["figures"])
    names = {drawing.name for drawing in shown}
    rest = [drawing for drawing in drawings if drawing.name not in names]
    with drawn_meanwhile(rest, folders["figures"]) as paths:
        page = make_report(found, tables, drawings, left_out, folders["figures"])
    written += paths
    report = run / "report.html"
    write_atomically(report, page)
    _clear(folders, written)
    return [*written, report]


def tables_text(run: str | Path) -> str:
    """The tables that `write_results` wrote, as text for the terminal. Raises InputError if there are none."""
    path = Path(run) / "tables" / _TEXT
    try:
        return path.read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError):
        raise InputError(f"{path}: cannot be read; `python -m conespot.results {run}` writes it") from None


def _folder(path: Path) -> Path:
    if path.is_symlink():  # a stranger's run must not send files elsewhere
        raise InputError(f"{path}: is a link to somewhere else; remove it")
    try:
        path.mkdir(exist_ok=True)
    except OSError as error:
        raise InputError(f"{path}: cannot be made: {error.strerror}") from None
    return path


def _clear(folders: dict[str, Path], written: list[Path]) -> None:
    """Remove what an earlier report made and this one does not, and nothing else."""
    tables = {_TEXT, _MARKDOWN, *(f"{name}.csv" for name in TABLE_NAMES)}
    stale = [path for path in folders["tables"].iterdir() if path.name in tables]
    stale += [path for path in folders["figures"].iterdir() if any(kind.made(path.name) for kind in FIGURES.values())]
    for path in stale:
        if path not in written:
            path.unlink()
