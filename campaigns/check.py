"""`campaign check`: a run against what its campaign, or another's file, expects of it."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from conespot.scene import InputError


@dataclass(frozen=True)
class Checked:
    """The verdicts as `text`; `missed` says how many do not hold, `unclear` what this run can neither meet nor miss."""

    text: str
    missed: int
    unclear: str


def check_run(folder: Path, campaign: str | None, junit_file: Path | None, markdown_file: Path | None) -> Checked:
    """Compare a run with what the file `campaign` expects, by default its own; writes JUnit XML and markdown.

    Raises InputError for a folder that is no run, and where nothing is expected.
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
    # nothing, or more than one number, is what these are about
    unclear = [f"{document.place(('expect', i))}: {v.title}: {v.unclear}" for i, v in enumerate(verdicts) if v.unclear]
    more = f" (and {len(unclear) - 1} more)" if len(unclear) > 1 else ""
    text = table.text() if len(unclear) < len(verdicts) else ""
    return Checked(text, sum(not v.holds and not v.unclear for v in verdicts), "".join(unclear[:1]) + more)
