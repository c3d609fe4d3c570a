"""Lines of a CSV file that somebody else wrote: bounded in size, without what is no data."""

from __future__ import annotations

from pathlib import Path

_MAX_BYTES = 20_000_000


def csv_lines(path: Path, what: str) -> list[tuple[int, str]]:
    """The numbered lines that are neither blank nor begin with `#`. Raises ValueError if the file is no `what`."""
    try:
        if path.stat().st_size > _MAX_BYTES:
            raise ValueError(f"{path}: larger than 20 MB, not a {what}")
        lines = path.read_text("utf-8-sig").splitlines()
    except (OSError, UnicodeDecodeError) as error:
        raise ValueError(f"{path}: cannot be read as CSV ({error})") from None
    return [(number, line) for number, line in enumerate(lines, 1) if line.strip() and not line.startswith("#")]
