"""`campaign check`: a run against what its campaign, or another's file, expects of it."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from conespot.scene import InputError


@dataclass(frozen=True)
class Checked:
    """The verdicts as `text`; `missed` says how many do not hold."""

    text: str
    missed: int


def check_run(folder: Path, campaign: str | None, junit_file: Path | None, markdown_file: Path | None) -> Checked:
    """Compare a run with what the file `campaign` expects, by default its own; writes JUnit XML and markdown.

    Raises InputError for a folder that is no run, where nothing is expected, and, after everything is written, for
    expectations that this run cannot meet or miss: nothing, or more than one number, is what they are about.
    """
    from conespot.campaigns.schema import read_campaign
    from conespot.results.check import check, expected, verdict_table
    from conespot.results.junit import junit
    from conespot.results.run import load_run
    from conespot.scene.atomic import write_atomically

    run = load_run(folder)
    document = run.document if campaign is None else read_campaign(campaign)
    verdicts = check(run, expected(document))
    if not verdicts:
        raise InputError(f"{document.source}: expect: nothing is expected; --campaign FILE names a file that does")
    table = verdict_table(verdicts)
    if junit_file is not None:
        write_atomically(junit_file, junit(run.name, verdicts), "--junit")
    if markdown_file is not None:
        write_atomically(markdown_file, table.markdown().encode(), "--markdown")
    unclear = [(i, v) for i, v in enumerate(verdicts) if v.unclear]
    if unclear:
        i, first = unclear[0]
        more = f" (and {len(unclear) - 1} more)" if len(unclear) > 1 else ""
        raise InputError(f"{document.place(('expect', i))}: {first.title}: {first.unclear}{more}")
    return Checked(table.text(), sum(not v.holds for v in verdicts))
