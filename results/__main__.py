"""`python -m conespot.results RUN`: tables, figures and report of a run folder, one's own or somebody else's."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

from conespot.results import tables_text, write_results
from conespot.scene import InputError

_WHAT = "Tables, figures and report of a run folder, one's own or somebody else's."


def main(arguments: list[str] | None = None) -> int:
    """The command; returns its exit code: 2 for a run folder that cannot be used."""
    parser = argparse.ArgumentParser(prog="python -m conespot.results", description=_WHAT)
    parser.add_argument("run", type=Path, help="folder with campaign.yaml and errors.parquet or errors.csv")
    run = parser.parse_args(arguments).run
    try:
        written = write_results(run)
        sys.stdout.write(f"{tables_text(run)}\n{len(written)} files; the report is {run / 'report.html'}\n")
    except InputError as error:
        sys.stderr.write(f"{error}\n")
        return 2
    return 0


if __name__ == "__main__":
    sys.exit(main())
