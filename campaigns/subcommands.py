"""What each command of `campaign` does with its options. Everything heavy is imported where it is used."""

from __future__ import annotations

import contextlib

from conespot.campaigns import streams
from conespot.campaigns.ending import Ending, RunError

TYPE_CHECKING = False  # `typing` takes long to import
if TYPE_CHECKING:
    import argparse
    from pathlib import Path

    from conespot.campaigns.session import Session


def validate(options: argparse.Namespace) -> Ending:
    """Check a campaign."""
    from conespot.campaigns.plan import make_plan
    from conespot.campaigns.settings import document_of

    planned = make_plan(document_of(options))
    _say(f"{options.campaign}: valid, {len(planned.cases)} cases, {planned.rows} rows")
    return Ending.DONE


def plan(options: argparse.Namespace) -> Ending:
    """Say what a run would do."""
    from conespot.campaigns.machines import jobs_in_words, profile_of
    from conespot.campaigns.plan import make_plan
    from conespot.campaigns.plan_words import describe
    from conespot.campaigns.settings import document_of

    profile = profile_of(options)
    _say("\n".join(describe(make_plan(document_of(options)), profile.workers if profile else options.workers)))
    if jobs := jobs_in_words(profile):
        _say(jobs)
    return Ending.DONE


def run(options: argparse.Namespace) -> Ending:
    """Run a campaign, or go on with it."""
    if options.dry_run:
        return plan(options)
    from conespot.campaigns.settings import document_of

    document = document_of(options)
    from conespot.campaigns.log import Log
    from conespot.campaigns.machines import executor_of, shard_of
    from conespot.campaigns.session import carry_out

    log = Log(options.log) if options.log else None
    return _end(carry_out(document, options.out, executor_of(options), shard_of(options), log=log, crops=options.crops))


def retry(options: argparse.Namespace) -> Ending:
    """Run poses of a run again."""
    from conespot.campaigns.log import Log
    from conespot.campaigns.machines import executor_of
    from conespot.campaigns.steering import retry

    log = Log(options.log) if options.log else None
    return _end(retry(options.folder, options.reason, executor_of(options), log))


def status(options: argparse.Namespace) -> Ending:
    """Say how far a run is."""
    from conespot.campaigns.steering import status

    _say(status(options.folder))
    return Ending.DONE


def theory(options: argparse.Namespace) -> Ending:
    """Say how well a scene could be localized."""
    from conespot.campaigns.theory_run import write_theory_of

    folder, text = write_theory_of(options.scene, options.set, options.out)
    _mention(text)
    _mention(f"{folder}: table_1.csv, bounds.csv, budget.csv, design.csv, theory.txt, budget and design as PNG and SVG")
    return Ending.DONE


def report(options: argparse.Namespace) -> Ending:
    """Make what a run folder holds again from its journal, or lay several runs side by side."""
    from conespot.campaigns.session import report, report_beside
    from conespot.scene.document import InputError

    if len(options.folders) > 1:
        if options.crops:
            raise InputError("--crops goes with one run folder; make the crops of each by itself")
        path, sentences = report_beside(options.folders, options.out)
        _mention("\n".join([*sentences, f"{path}: the runs on one page"]))
        return Ending.DONE
    if options.out:
        raise InputError("--out goes with several run folders; the report of one stands in it, as report.html")
    (folder,) = options.folders
    report(folder, options.crops, options.workers)
    say_results(folder)
    return Ending.DONE


def merge(options: argparse.Namespace) -> Ending:
    """Make one run folder of several."""
    from conespot.campaigns.merge import merge
    from conespot.campaigns.session import finish

    merged = merge(options.out, options.folders)
    for sentence in merged.damage:
        _fail(sentence, Ending.FAILED)
    finish(options.out)
    say_results(options.out)
    return _fail(merged.sentence, Ending.FAILED) if merged.missing else Ending.DONE


def compare(options: argparse.Namespace) -> Ending:
    """Compare two lights."""
    from conespot.campaigns.compare import compare

    _mention(compare(options.folders, options.lights))
    _mention(f"{options.folders[0]}: comparison.txt, tables/comparison.csv, figures/comparison_*")
    return Ending.DONE


def check(options: argparse.Namespace) -> Ending:
    """Compare a run with what is expected of it."""
    from conespot.campaigns.check import check_run

    checked = check_run(options.folder, options.campaign, options.junit, options.markdown)
    if checked.text:
        _say(checked.text)
    if checked.missed:
        _fail(f"{checked.missed} expectations missed", Ending.FAILED)
    if checked.unclear:
        return _fail(checked.unclear, Ending.BAD_INPUT)
    return Ending.FAILED if checked.missed else Ending.DONE


def pack(options: argparse.Namespace) -> Ending:
    """Make one archive of a run."""
    from conespot.campaigns.pack import pack

    _say(pack(options.folder, options.out))
    return Ending.DONE


def verify(options: argparse.Namespace) -> Ending:
    """Check an archive of a run."""
    from conespot.campaigns.pool import LocalPool
    from conespot.campaigns.verify import verify

    verdict = verify(options.archive, options.sample, options.seed, LocalPool(options.workers))
    for sentence in verdict.said:
        _say(sentence)
    for sentence in verdict.wrong:
        _fail(sentence, Ending.FAILED)
    _say(f"{options.archive}: {'does not hold' if verdict.wrong else 'holds'}")
    return Ending.FAILED if verdict.wrong else Ending.DONE


def debug(options: argparse.Namespace) -> Ending:
    """Render one pose again, and draw what was seen."""
    from conespot.campaigns.debug import debug

    for line in debug(options.folder, options.case, options.pose):
        _say(line)
    return Ending.DONE


def localize(options: argparse.Namespace) -> Ending:
    """Localize frames of one's own camera."""
    from conespot.campaigns.own_frames import Count, OwnFrames, localize, make_alarm, make_rate, outputs

    own, count = OwnFrames(options.scene, options.set, options.localizer, make_rate(options.rate)), Count()
    alarm = make_alarm(options.alarm, options.false_safe, own.scene)
    beside = outputs(own, alarm, options)
    if options.reference:
        own.learn(options.reference)
    for line in localize(own, options.frames, alarm, beside, count):
        _say(line)
    return _fail(count.sentence, Ending.FAILED) if count.sentence else Ending.DONE


def calibrate(options: argparse.Namespace) -> Ending:
    """Calibrate a scene from frames of one's own."""
    from conespot.campaigns.own_calibration import calibrate_own

    asked = {"shape": options.shape, "tilt": options.tilt}
    for line in calibrate_own(options.frames, options.scene, options.set, options.out, **asked):
        _say(line)
    return Ending.DONE


def doctor(options: argparse.Namespace) -> Ending:
    """Say what this machine renders with."""
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


def _end(session: Session) -> Ending:
    """Say how a session ended."""
    if session.interrupted:
        return _fail(session.interrupted, Ending.INTERRUPTED)
    say_results(session.folder)
    return _fail(session.sentence, Ending.FAILED) if session.lost else Ending.DONE


def say_results(folder: Path) -> None:
    """Say the tables of a run folder, and what else it holds."""
    from conespot.results import tables_text

    _mention(tables_text(folder))
    _mention(f"{folder}: errors.csv, errors.parquet, boxes.csv, tables/, figures/; read report.html first")


def _fail(error: object, code: Ending) -> Ending:
    streams.complain(f"campaign: {error}")
    return code


def _say(text: object) -> None:
    """Say what the user asked to read."""
    streams.say(text)


def _mention(text: object) -> None:
    """Say what stands in files too, so that nothing is lost if nobody hears it."""
    with contextlib.suppress(streams.UnheardError):
        streams.say(text)
