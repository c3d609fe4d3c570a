"""The command `campaign`. Everything heavy is imported where it is used, so that --help is instant."""

from __future__ import annotations

import contextlib
import os
import sys

from conespot.campaigns import streams
from conespot.campaigns.ending import Ending, RunError
from conespot.campaigns.interruption import interruption

TYPE_CHECKING = False  # `typing` takes long to import, and until `main` begins Ctrl-C gives a traceback
if TYPE_CHECKING:
    import argparse
    from collections.abc import Callable, Sequence
    from pathlib import Path

    from conespot.campaigns.session import Session


def main(arguments: Sequence[str] | None = None) -> int:
    """Run a command line; the exit code: 0 done, 1 something failed, 2 bad input, 130 interrupted.

    Without `arguments` it is the process's own, and its signals are `campaigns.interruption`'s; else the caller's.
    """
    if arguments is None:
        interruption.listen()
        streams.make_safe()
        os.environ["MPLBACKEND"] = "agg"  # figures are files, whatever a notebook or a desktop has left there
    options = _parser().parse_args(arguments)
    from conespot.scene.document import InputError

    try:
        code: Ending = options.run(options)
        return code
    except InputError as error:
        return _complain(error, Ending.BAD_INPUT)
    except KeyboardInterrupt:
        return _complain("interrupted", Ending.INTERRUPTED)
    except streams.UnheardError as error:
        # silently where the reader went away, as in `campaign plan | head`
        return _complain(error, Ending.FAILED) if str(error) else Ending.FAILED
    except RunError as error:
        return _complain(error, Ending.FAILED)
    except Exception as error:
        # a defect: the user gets a sentence, and the traceback by asking for it
        if os.environ.get("CONESPOT_TRACEBACK"):
            raise
        return _complain(f"{type(error).__name__}: {error} (CONESPOT_TRACEBACK=1 shows where)", Ending.FAILED)


def _complain(error: object, code: Ending) -> Ending:
    streams.complain(f"campaign: {error}")
    return code


def _say(text: object) -> None:
    """Say what the user asked to read."""
    streams.say(text)


def _mention(text: object) -> None:
    """Say what stands in files too, so that nothing is lost if nobody hears it."""
    with contextlib.suppress(streams.UnheardError):
        streams.say(text)


def _parser() -> argparse.ArgumentParser:
    import argparse
    from pathlib import Path

    from conespot.campaigns.machines import add_machines
    from conespot.campaigns.settings import add_set, add_settings

    parser = argparse.ArgumentParser(
        prog="campaign",
        description="Render spotlights on a retina, localize the instrument that carries them, compare with the truth.",
        epilog="exit codes: 0 done, 1 something failed, 2 bad input, 130 interrupted",
    )
    commands = parser.add_subparsers(required=True, metavar="COMMAND")

    def add(name: str, run: Callable[[argparse.Namespace], Ending], help_: str) -> argparse.ArgumentParser:
        command = commands.add_parser(name, help=help_, description=f"{help_[0].upper()}{help_[1:]}.")
        command.set_defaults(run=run)
        return command

    run = add("run", _run, "render, localize and compare; an interrupted run is continued")
    plan = add("plan", _plan, "say what a run would do")
    validate = add("validate", _validate, "check a campaign and every combination it sweeps over")
    theory = add("theory", _theory, "say how well a scene could be localized: bounds, error budget, design guidance")
    theory.add_argument("scene", nargs="?", default="paper-code", help="a preset or a YAML file (default: paper-code)")
    for command in (run, plan, validate, theory):
        if command is not theory:
            command.add_argument("campaign", help="a YAML file, or the name of a shipped campaign")
        add_set(command)
    for command in (run, plan, validate):
        add_settings(command)
    run.add_argument("--dry-run", action="store_true", help="only say what the run would do")
    run.add_argument("--out", metavar="FOLDER", help="the run folder (default: runs/NAME)")
    run.add_argument("--shard", metavar="I/N", help="only this share of the poses, into a folder that `merge` reads")
    theory.add_argument("--out", metavar="FOLDER", help="where to write (default: runs/theory-SCENE)")
    for command in (run, plan):
        add_machines(command)
    listed = add("list", _list, "list the shipped campaigns")
    listed.add_argument("--localizers", action="store_true", help="list the localizers in their place")
    add("show", _show, "print a campaign's file").add_argument("campaign")
    run.add_argument("--log", metavar="FILE", type=Path, help="append what happens to a file, a JSON object a line")
    status = add("status", _status, "say how far a run is, while it goes or after, and why poses failed")
    status.add_argument("folder", type=Path, metavar="RUN")
    retry = add("retry", _retry, "run poses of a run again, such as: campaign retry runs/power_sweep --failed")
    retry.add_argument("folder", type=Path, metavar="RUN")
    which = retry.add_mutually_exclusive_group(required=True)
    which.add_argument("--failed", action="store_true", help="those that were lost to an error")
    which.add_argument("--reason", metavar="TEXT", help="those with a frame that failed for a reason that holds TEXT")
    add_machines(retry)
    retry.add_argument("--log", metavar="FILE", type=Path, help="as for run")
    report = add("report", _report, "make the tables, figures and report of a run folder again")
    report.add_argument("folder", type=Path, metavar="RUN")
    merge = add("merge", _merge, "make one run folder of those of a campaign's shards")
    merge.add_argument("out", type=Path, metavar="OUT")
    merge.add_argument("folders", type=Path, nargs="+", metavar="SHARD")
    compare = add("compare", _compare, "compare two lights pose by pose, in one run or several")
    compare.add_argument("folders", type=Path, nargs="+", metavar="RUN")
    compare.add_argument("--lights", metavar="A,B", help="reference and other light (default: the first against all)")
    check = add("check", _check, "compare a run with what its campaign expects (`expect:`); exit code 1 for a miss")
    check.add_argument("folder", type=Path, metavar="RUN")
    check.add_argument("--campaign", metavar="FILE", help="expect what this campaign does (default: the run's own)")
    check.add_argument("--junit", type=Path, metavar="FILE", help="write the verdicts as JUnit XML")
    check.add_argument("--markdown", type=Path, metavar="FILE", help="write the verdicts as a markdown table")
    debug = add("debug", _debug, "render one pose of a run again, and draw what its localizers saw")
    debug.add_argument("folder", type=Path, metavar="RUN")
    debug.add_argument("case", metavar="CASE", help="its key, the beginning of it, or its line in cases.jsonl")
    debug.add_argument("pose", type=int, metavar="POSE", help="its number, as in errors.csv")
    doctor = add("doctor", _doctor, "say what this machine renders with, and prove it")
    doctor.add_argument("--clear-cache", action="store_true", help="remove the backgrounds kept between runs instead")
    return parser


def _validate(options: argparse.Namespace) -> Ending:
    from conespot.campaigns.plan import make_plan
    from conespot.campaigns.settings import document_of

    plan = make_plan(document_of(options))
    _say(f"{options.campaign}: valid, {len(plan.cases)} cases, {plan.rows} rows")
    return Ending.DONE


def _plan(options: argparse.Namespace) -> Ending:
    from conespot.campaigns.machines import jobs_in_words, profile_of
    from conespot.campaigns.plan import make_plan
    from conespot.campaigns.plan_words import describe
    from conespot.campaigns.settings import document_of

    profile = profile_of(options)
    _say("\n".join(describe(make_plan(document_of(options)), profile.workers if profile else options.workers)))
    if jobs := jobs_in_words(profile):
        _say(jobs)
    return Ending.DONE


def _run(options: argparse.Namespace) -> Ending:
    if options.dry_run:
        return _plan(options)
    from conespot.campaigns.settings import document_of

    document = document_of(options)
    from conespot.campaigns.log import Log
    from conespot.campaigns.machines import executor_of, shard_of
    from conespot.campaigns.session import carry_out

    log = Log(options.log) if options.log else None
    return _end(carry_out(document, options.out, executor_of(options), shard_of(options), log=log))


def _retry(options: argparse.Namespace) -> Ending:
    from conespot.campaigns.log import Log
    from conespot.campaigns.machines import executor_of
    from conespot.campaigns.steering import retry

    log = Log(options.log) if options.log else None
    return _end(retry(options.folder, options.reason, executor_of(options), log))


def _status(options: argparse.Namespace) -> Ending:
    from conespot.campaigns.steering import status

    _say(status(options.folder))
    return Ending.DONE


def _end(session: Session) -> Ending:
    """Say how a session ended."""
    if session.interrupted:
        return _complain(session.interrupted, Ending.INTERRUPTED)
    _say_results(session.folder)
    return _complain(session.sentence, Ending.FAILED) if session.lost else Ending.DONE


def _theory(options: argparse.Namespace) -> Ending:
    from conespot.campaigns.theory_run import write_theory_of

    folder, text = write_theory_of(options.scene, options.set, options.out)
    _mention(text)
    _mention(f"{folder}: table_1.csv, bounds.csv, budget.csv, design.csv, theory.txt, budget and design as PNG and SVG")
    return Ending.DONE


def _report(options: argparse.Namespace) -> Ending:
    from conespot.campaigns.session import report

    report(options.folder)
    _say_results(options.folder)
    return Ending.DONE


def _merge(options: argparse.Namespace) -> Ending:
    from conespot.campaigns.merge import merge
    from conespot.results import write_results

    merged = merge(options.out, options.folders)
    for sentence in merged.damage:
        _complain(sentence, Ending.FAILED)
    write_results(options.out)
    _say_results(options.out)
    return _complain(merged.sentence, Ending.FAILED) if merged.missing else Ending.DONE


def _compare(options: argparse.Namespace) -> Ending:
    from conespot.campaigns.compare import compare

    _mention(compare(options.folders, options.lights))
    _mention(f"{options.folders[0]}: comparison.txt, tables/comparison.csv, figures/comparison_*")
    return Ending.DONE


def _check(options: argparse.Namespace) -> Ending:
    from conespot.campaigns.check import check_run

    checked = check_run(options.folder, options.campaign, options.junit, options.markdown)
    _say(checked.text)
    return _complain(f"{checked.missed} expectations missed", Ending.FAILED) if checked.missed else Ending.DONE


def _debug(options: argparse.Namespace) -> Ending:
    from conespot.campaigns.debug import debug

    for line in debug(options.folder, options.case, options.pose):
        _say(line)
    return Ending.DONE


def _say_results(folder: Path) -> None:
    from conespot.results import tables_text

    _mention(tables_text(folder))
    _mention(f"{folder}: errors.csv, errors.parquet, boxes.csv, tables/, figures/; read report.html first")


def _list(options: argparse.Namespace) -> Ending:
    if options.localizers:
        from conespot.localize.locate import in_words

        for line in in_words():
            _say(line)
        return Ending.DONE
    from conespot.scene.document import read_document, shipped

    for name, path in shipped("campaigns", "").items():
        _say(f"{name:16} {read_document(path).data.get('description', '')}")
    return Ending.DONE


def _show(options: argparse.Namespace) -> Ending:
    from conespot.scene.document import find_document, read_document

    path = find_document(options.campaign, "campaigns", "", "campaign")
    read_document(path)  # no control characters reach a terminal
    streams.write(path.read_text("utf-8-sig"))
    return Ending.DONE


def _doctor(options: argparse.Namespace) -> Ending:
    from conespot.render import kept
    from conespot.render.doctor import examine
    from conespot.render.kernel import KernelError

    if options.clear_cache:
        _say(f"removed {kept.clear() / 1e6:.0f} MB of backgrounds")
        return Ending.DONE
    try:
        for line in examine():
            _say(line)
    except KernelError as error:
        raise RunError(str(error)) from None
    return Ending.DONE


if __name__ == "__main__":
    sys.exit(main())
