"""The rows of a run, hostile until validated: one row per frame and localizer."""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pandas as pd
import pyarrow as pa
import pyarrow.csv
import pyarrow.parquet
from pandas.api.types import is_numeric_dtype

from conespot.results.columns import COLUMNS, MAX_ROWS, SETTING, Column
from conespot.scene import InputError

_MAX_BYTES = 500_000_000
_MAX_COLUMNS = 200
_MAX_GROUPS = 50_000
_MAX_TEXT = 1000
_MAX_NAME = 200
_LOCALIZER = re.compile(r"[\w .+-]{1,60}", re.ASCII)
_NEEDED = tuple(c.name for c in COLUMNS if not c.optional)
_TEXT = tuple(c.name for c in COLUMNS if c.kind == "text")


@dataclass(frozen=True)
class Rows:
    """Validated rows. `frame` has the declared columns in their order, of the optional ones those that the run has,
    then `swept`. Numbers are float64, whole ones int64, names text.
    """

    frame: pd.DataFrame
    swept: tuple[str, ...] = ()

    @property
    def group(self) -> tuple[str, ...]:
        """Columns that make rows comparable."""
        return (*SETTING, *self.swept)

    def __len__(self) -> int:
        return len(self.frame)


def find_rows(folder: Path) -> Path | None:
    """The file with a run's rows: errors.parquet, or else errors.csv; None if there is neither."""
    return next((p for p in (folder / "errors.parquet", folder / "errors.csv") if p.is_file()), None)


def read_rows(path: Path, swept: Iterable[str] = ()) -> Rows:
    """Rows from a parquet or CSV file.

    A column beyond the known ones belongs to a swept key if its name is a dotted path or stands in `swept`; other
    columns that begin with `est_` are the estimator's own and left alone. Raises InputError for a file that cannot be
    read, is too large, lacks a column, has another one, or holds values of the wrong type or out of bounds.
    """
    keys = tuple(swept)
    table = read_table(path, MAX_ROWS, text=(*_TEXT, *keys))
    missing = [name for name in _NEEDED if name not in table.column_names]
    if missing:
        raise InputError(f"{path}: no column {', '.join(missing)}; a run's rows have all of {', '.join(_NEEDED)}")
    declared = [c for c in COLUMNS if c.name in table.column_names]
    known = {c.name for c in declared}
    extra: list[str] = []
    for name in table.column_names:
        if name in known or name.startswith("est_"):
            continue
        if "." not in name and name not in keys:
            raise InputError(f"{path}: unknown column '{name}'; a swept key's column is named by its dotted path")
        extra.append(name)
    data: dict[str, pd.Series] = {}
    for c in declared:
        data[c.name] = (text_column if c.kind == "text" else number_column)(table, c.name, path)
    for name in extra:
        data[name] = _swept_column(table, name, path)
    rows = Rows(pd.DataFrame(data), tuple(extra))
    _check(rows, declared, path)
    for c in declared:
        if c.kind == "whole":
            rows.frame[c.name] = rows.frame[c.name].astype("int64")
    return rows


def read_table(path: Path, max_rows: int, text: Sequence[str] = ()) -> pa.Table:
    """A parquet or CSV file as a table of at most `max_rows`; `text` are the columns a CSV file holds as text.

    Raises InputError.
    """
    try:
        if path.stat().st_size > _MAX_BYTES:
            raise InputError(f"{path}: larger than {_MAX_BYTES // 1_000_000} MB, which no run's rows need")
        if path.suffix == ".parquet":
            # Arrow opens no path that is not UTF-8
            with path.open("rb") as stream, pa.parquet.ParquetFile(stream) as file:
                meta = file.metadata
                inflated = sum(meta.row_group(i).total_byte_size for i in range(meta.num_row_groups))
                _bound(path, meta.num_rows, meta.num_columns, max_rows)
                if any(pa.types.is_nested(field.type) for field in file.schema_arrow):
                    raise InputError(f"{path}: a column holds lists or records, which no run's rows have")
                if inflated > 4 * _MAX_BYTES:
                    raise InputError(f"{path}: unpacks to {inflated // 1_000_000} MB, which no run's rows need")
                table = file.read()
        else:
            table = _read_csv(path, text)
    except (pa.ArrowException, OSError, UnicodeDecodeError) as error:
        reason = " ".join(str(getattr(error, "strerror", None) or error).split())
        raise InputError(f"{path}: cannot be read as {path.suffix[1:]}: {reason[:300]}") from None
    _bound(path, table.num_rows, table.num_columns, max_rows)
    if len(set(table.column_names)) < table.num_columns:
        raise InputError(f"{path}: a column stands twice; every column needs a name of its own")
    return table


def _read_csv(path: Path, text: Sequence[str]) -> pa.Table:
    with path.open("rb") as stream:
        header = pa.csv.read_csv(pa.py_buffer(stream.readline(100_000))).column_names
        types = {name: pa.string() if name in text or "." in name else pa.float64() for name in header}
        options = pa.csv.ConvertOptions(column_types=types, null_values=["", "nan", "NaN"], strings_can_be_null=False)
        parsing = pa.csv.ParseOptions(newlines_in_values=True)
        stream.seek(0)
        return pa.csv.read_csv(stream, parse_options=parsing, convert_options=options)


def _bound(path: Path, rows: int, columns: int, max_rows: int) -> None:
    if rows > max_rows or columns > _MAX_COLUMNS:
        raise InputError(
            f"{path}: {rows} rows of {columns} columns are more than results reads ({max_rows} of {_MAX_COLUMNS})"
        )


def text_column(table: pa.Table, name: str, path: Path) -> pd.Series:
    """A column of text, without null. Raises InputError."""
    kind = table.schema.field(name).type
    value = kind.value_type if pa.types.is_dictionary(kind) else kind
    if not (pa.types.is_string(value) or pa.types.is_large_string(value) or pa.types.is_null(value)):
        raise InputError(f"{path}: the column {name} holds {kind}, not text")
    values = table.column(name).cast(pa.string()).fill_null("")
    longest = max((len(v) for v in values.unique().to_pylist()), default=0)
    if longest > _MAX_TEXT:
        raise InputError(f"{path}: the column {name} holds a text of {longest} characters; {_MAX_TEXT} is the most")
    return pd.Series(values.to_numpy(zero_copy_only=False), dtype=object)


def number_column(table: pa.Table, name: str, path: Path) -> pd.Series:
    """A column of numbers as float64, NaN for null. Raises InputError."""
    kind = table.schema.field(name).type
    if not (pa.types.is_integer(kind) or pa.types.is_floating(kind) or pa.types.is_null(kind)):
        raise InputError(f"{path}: the column {name} holds {kind}, not numbers")
    values = table.column(name).cast(pa.float64(), safe=False)
    return pd.Series(np.asarray(values.to_numpy(zero_copy_only=False), float))


def _swept_column(table: pa.Table, name: str, path: Path) -> pd.Series:
    """A swept key's values: numbers if all of them are, else text, so CSV and parquet give the same groups."""
    kind = table.schema.field(name).type
    if pa.types.is_boolean(kind):
        return text_column(table.set_column(0, name, table.column(name).cast(pa.string())), name, path)
    if pa.types.is_integer(kind) or pa.types.is_floating(kind):
        return number_column(table, name, path)
    words = text_column(table, name, path)
    numbers = pd.to_numeric(words, errors="coerce")
    return numbers if bool(np.isfinite(numbers).all()) else words


def _check(rows: Rows, declared: Sequence[Column], path: Path) -> None:
    frame = rows.frame
    _require(frame["status"].isin(("ok", "failed")), "status must be ok or failed", path)
    for name in rows.group:
        if not is_numeric_dtype(frame[name]):
            _check_names(frame[name].unique(), name, path)
        elif name in rows.swept:
            _require(np.isfinite(frame[name]), f"{name} must be a finite number", path)
    for c in declared:
        if c.kind != "text":
            _check_numbers(frame, c, path)
    _require(~frame.duplicated(["case", "pose", *rows.group]), "the same case, pose and localizer stand twice", path)
    groups = len(frame.drop_duplicates(list(rows.group)))
    if groups > _MAX_GROUPS:
        raise InputError(f"{path}: {groups} different settings are more than results reads ({_MAX_GROUPS})")


def _check_numbers(frame: pd.DataFrame, c: Column, path: Path) -> None:
    """The column's bounds; an error must stand where a frame was localized, a truth or a sigma may be missing."""
    values = frame[c.name]
    inside = (values >= c.least) & (values <= c.most)  # false for NaN
    match c.group:
        case "error":
            failed = frame["status"] == "failed"
            _require(np.isfinite(values) | failed, f"{c.name} must be a number where status is ok", path)
            inside |= failed
        case "truth" | "answer" | "stated":
            inside |= values.isna()
        case _ if c.kind == "whole":
            inside &= values == np.floor(values)
        case _:
            _require(np.isfinite(values), f"{c.name} must be a finite number", path)
    _require(inside, f"{c.name} must {_bounds(c)}", path)


def _bounds(c: Column) -> str:
    if c.kind == "whole":
        return f"be a whole number from {c.least:g}"
    if c.least == 0.0 and math.isinf(c.most):
        return "not be negative"
    return f"be from {c.least:g} to {c.most:g}"


def _check_names(names: Iterable[str], column: str, path: Path) -> None:
    for name in names:
        if not name.isprintable() or not 1 <= len(name) <= _MAX_NAME:
            raise InputError(f"{path}: {column} is {name[:40]!r}; it must be 1 to {_MAX_NAME} printable characters")
        if column == "localizer" and not _LOCALIZER.fullmatch(name):
            raise InputError(f"{path}: {name[:40]!r} is no localizer's name; letters, digits, space and .+-_ make one")


def _require(good: pd.Series, sentence: str, path: Path) -> None:
    if not good.all():
        raise InputError(f"{path}: row {int(np.flatnonzero(~good.to_numpy())[0]) + 1}: {sentence}")
