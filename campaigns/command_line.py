"""The command line of `campaign`: its commands and their options. What these do stands in modules of their own."""

from __future__ import annotations

import argparse
from collections.abc import Callable
from pathlib import Path

from conespot.campaigns import authoring, following, new_microscope, other_methods, subcommands
from conespot.campaigns.ending import Ending
from conespot.campaigns.examples import epilog
from conespot.campaigns.machines import add_machines, add_workers, few
from conespot.campaigns.new_campaign import QUESTIONS
from conespot.campaigns.questions import add_questions
from conespot.campaigns.settings import add_set, add_settings

#: adds the command that a function does, called as it is, with what it says of itself
_Add = Callable[[Callable[[argparse.Namespace], Ending], str], argparse.ArgumentParser]


class _AsWritten(argparse.RawDescriptionHelpFormatter):
    """Keeps the lines of examples."""

    def _fill_text(self, text: str, width: int, indent: str) -> str:
        if text.startswith("example"):
            return super()._fill_text(text, width, indent)
        return argparse.HelpFormatter._fill_text(self, text, width, indent)


def parser() -> argparse.ArgumentParser:
    """The commands of `campaign` and their options; what is parsed says in `run` who does it."""
    line = argparse.ArgumentParser(
        prog="campaign",
        description="Render spotlights on a retina, localize the instrument that carries them, compare with the truth.",
        epilog="exit codes: 0 done, 1 something failed, 2 bad input, 130 interrupted",
    )
    commands = line.add_subparsers(required=True, metavar="COMMAND")

    def add(run: Callable[[argparse.Namespace], Ending], text: str) -> argparse.ArgumentParser:
        says = f"{text[0].upper()}{text[1:]}."
        command = commands.add_parser(
            run.__name__, help=text, description=says, epilog=epilog(run.__name__), formatter_class=_AsWritten
        )
        command.set_defaults(run=run)
        return command

    _add_campaigns(add)
    _add_runs(add)
    _add_results(add)
    _add_own(add)
    doctor = add(subcommands.doctor, "say what this machine renders with, and prove it")
    doctor.add_argument("--clear-cache", action="store_true", help="remove the backgrounds kept between runs instead")
    return line


def _add_campaigns(add: _Add) -> None:
    """What begins with a campaign or a scene."""
    init = add(authoring.init, "write a commented campaign or microscope of your own, from a few answers or options")
    named = "(default: my_campaign.yaml, or my_microscope.yaml)"
    init.add_argument("file", nargs="?", type=Path, help=named)
    init.add_argument("--microscope", action="store_true", help="write the scene of your own microscope instead")
    init.add_argument("--defaults", action="store_true", help="ask nothing, take the default where no option is given")
    add_questions(init, QUESTIONS, "the answers, asked for on a terminal")
    add_questions(init, new_microscope.QUESTIONS, "those of a microscope")
    run = add(subcommands.run, "render, localize and compare; an interrupted run is continued")
    plan = add(subcommands.plan, "say what a run would do")
    preview = add(authoring.preview, "draw one frame of a campaign in seconds, and its set-up from the side, to scale")
    preview.add_argument("--out", metavar="FILE", type=Path, help="the picture (default: NAME_preview.png)")
    validate = add(subcommands.validate, "check a campaign and every combination it sweeps over")
    theory = add(subcommands.theory, "say how well a scene could be localized: bounds, error budget, design guidance")
    theory.add_argument("scene", nargs="?", default="paper-code", help="a preset or a YAML file (default: paper-code)")
    for command in (run, plan, preview, validate, theory):
        if command is not theory:
            command.add_argument("campaign", help="a YAML file, or the name of a shipped campaign")
        add_set(command)
    for command in (run, plan, preview, validate):
        add_settings(command)
    run.add_argument("--dry-run", action="store_true", help="only say what the run would do")
    run.add_argument("--out", metavar="FOLDER", help="the run folder (default: runs/NAME)")
    run.add_argument("--shard", metavar="I/N", help="only this share of the poses, into a folder that `merge` reads")
    theory.add_argument("--out", metavar="FOLDER", help="where to write (default: runs/theory-SCENE)")
    for command in (run, plan):
        add_machines(command)
    crops = "keep pictures of the N worst frames of each box (default: 1 of a run of 300 rows or more, 0 for none)"
    run.add_argument("--crops", metavar="N", type=few, help=crops)
    run.add_argument("--log", metavar="FILE", type=Path, help="append what happens to a file, a JSON object a line")
    listed = add(authoring.list, "list the shipped campaigns")
    listed.add_argument("--localizers", action="store_true", help="list the localizers in their place")
    explain = add(authoring.explain, "say what a key of campaigns and scenes means")
    explain.add_argument("key", metavar="KEY", help="its dotted path, such as scene.beam.half_angle, or the end of it")
    schema = add(authoring.schema, "print the JSON Schema of campaigns, with which editors complete and check them")
    schema.add_argument("--scene", action="store_true", help="that of a scene's file, such as a preset, in its place")
    completed = add(authoring.completion, "print what lets a shell complete this command's commands and options")
    completed.add_argument("shell", choices=("bash", "zsh"), metavar="SHELL", help="bash or zsh")
    show = add(authoring.show, "print the file of a campaign, or of a scene preset")
    show.add_argument("campaign", help="its name, or a file")


def _count(text: str) -> int:
    if not (text.isascii() and text.isdecimal() and len(text) < 19):
        raise argparse.ArgumentTypeError("must be a whole number, 0 or more")
    return int(text)


def _lag(text: str) -> int:
    if not (text.isascii() and text.isdecimal() and len(text) < 4 and 1 <= int(text) <= 100):
        raise argparse.ArgumentTypeError("must be a whole number, 1 to 100")
    return int(text)


def _text(text: str) -> str:
    if not text.strip():
        raise argparse.ArgumentTypeError("is empty, which every reason holds")
    return text


def _add_runs(add: _Add) -> None:
    """What looks at a run, or goes on with it."""
    status = add(subcommands.status, "say how far a run is, while it goes or after, and why poses failed")
    status.add_argument("folder", type=Path, metavar="RUN")
    retry = add(subcommands.retry, "run poses of a run again, such as: campaign retry runs/power_sweep --failed")
    retry.add_argument("folder", type=Path, metavar="RUN")
    which = retry.add_mutually_exclusive_group(required=True)
    which.add_argument("--failed", action="store_true", help="those that were lost to an error")
    reason = "those with a frame that failed for a reason that holds TEXT"
    which.add_argument("--reason", metavar="TEXT", type=_text, help=reason)
    add_machines(retry)
    retry.add_argument("--log", metavar="FILE", type=Path, help="as for run")
    report = add(subcommands.report, "make the tables, figures and report of a run folder again; of several, one page")
    words = "a run folder; several are laid side by side on one page, the first as the reference"
    report.add_argument("folders", type=Path, nargs="+", metavar="RUN", help=words)
    report.add_argument(
        "--out", type=Path, metavar="FILE", help="of several: the page (side_by_side.html of the first)"
    )
    report.add_argument("--crops", metavar="N", type=few, default=0, help="render N worst frames of each box again")
    add_workers(report)


def _add_frames(command: argparse.ArgumentParser) -> None:
    """What finds the needle in frames, and where answers go."""
    command.add_argument("frames", type=Path, nargs="+", metavar="FRAMES", help="images, folders of images, videos")
    command.add_argument("--scene", required=True, help="the YAML file that describes the microscope, or a preset")
    command.add_argument("--localizer", default="cone", metavar="NAME", help="what finds the needle (default: cone)")
    command.add_argument("--reference", type=Path, nargs="+", metavar="FRAMES", help="frames without spotlights")
    command.add_argument("--csv", type=Path, metavar="FILE", help="write a row for each frame")
    command.add_argument("--json", type=Path, metavar="FILE", help="write the same with covariances")
    command.add_argument("--tum", type=Path, metavar="FILE", help="write a TUM trajectory")
    command.add_argument("--mcap", type=Path, metavar="FILE", help="write poses and frames as ROS 2 records them")
    command.add_argument("--rate", metavar="HZ", help="frames a second, such as '60 Hz', where they have no times")
    command.add_argument("--overlay", type=Path, metavar="FOLDER", help="draw what was seen in each frame")
    alarm = "say which tips are safe: farther from the wall than this, such as '0.1 mm' (research, no safety device)"
    command.add_argument("--alarm", metavar="DISTANCE", help=alarm)
    chance = "chance that a tip called safe is not, by the stated sigma (default: 0.001)"
    command.add_argument("--false-safe", type=float, metavar="P", help=chance)


def _add_own(add: _Add) -> None:
    """What takes frames of one's own camera."""
    localize = add(subcommands.localize, "find the needle in images, folders and videos of your own microscope")
    track = add(following.track, "follow the needle through a video, a recording or a folder of frames in order")
    for command in (localize, track):
        _add_frames(command)
    live = "drop the frames that come while the tracker is busy, as a camera would; else none is dropped"
    track.add_argument("--live", action="store_true", help=live)
    lag = "smooth each pose with as many frames after it, 1 to 100 (without --overlay and --mcap)"
    track.add_argument("--smooth", type=_lag, default=0, metavar="FRAMES", help=lag)
    calibrate = add(subcommands.calibrate, "find out of a sequence what it shows of your microscope and the eye")
    calibrate.add_argument("frames", type=Path, nargs="+", metavar="FRAMES", help="images, folders of images, videos")
    calibrate.add_argument("--scene", required=True, help="the YAML file that describes the microscope so far")
    calibrate.add_argument("--out", type=Path, required=True, metavar="FILE", help="the scene's file to write")
    calibrate.add_argument("--tilt", action="store_true", help="find which way the camera's axis leans, too")
    calibrate.add_argument("--shape", action="store_true", help="find the retina's semi-axes in place of its radius")
    add_set(localize)
    add_set(track)
    add_set(calibrate)


def _add_others(add: _Add) -> None:
    """What lets other people's methods be compared."""
    export = add(
        other_methods.export, "write a run's frames and what localizers are told, without the truth, for any method"
    )
    export.add_argument("folder", type=Path, metavar="RUN")
    export.add_argument("--frames", type=Path, metavar="FOLDER", required=True, help="where to write; goes on if begun")
    add_workers(export)
    score = add(other_methods.score, "join what another method found in exported frames to a run's rows and tables")
    score.add_argument("folder", type=Path, metavar="RUN")
    score.add_argument("estimates", type=Path, metavar="ESTIMATES", help="a CSV: frame,x_mm,y_mm,z_mm, an axis or none")
    score.add_argument("--name", required=True, help="what the method is called in tables")


def _add_results(add: _Add) -> None:
    """What compares, looks into or hands on what was found."""
    pack = add(subcommands.pack, "make one archive of a run, with checksums, that others can check and go on with")
    pack.add_argument("folder", type=Path, metavar="RUN")
    pack.add_argument("--out", type=Path, metavar="FILE", help="the archive (default: RUN.zip)")
    verify = add(subcommands.verify, "check an archive: checksums, rows, and a random sample of its poses once more")
    verify.add_argument("archive", type=Path, metavar="ARCHIVE")
    verify.add_argument("--sample", type=_count, default=10, metavar="N", help="poses to measure again (default: 10)")
    verify.add_argument(
        "--seed", type=_count, metavar="N", help="draw the same sample again (default: another each time)"
    )
    add_workers(verify)
    merge = add(subcommands.merge, "make one run folder of those of a campaign's shards")
    merge.add_argument("out", type=Path, metavar="OUT")
    merge.add_argument("folders", type=Path, nargs="+", metavar="SHARD")
    compare = add(subcommands.compare, "compare two lights pose by pose, in one run or several")
    compare.add_argument("folders", type=Path, nargs="+", metavar="RUN")
    compare.add_argument("--lights", metavar="A,B", help="reference and other light (default: the first against all)")
    check = add(subcommands.check, "compare a run with what its campaign expects (`expect:`); exit code 1 for a miss")
    check.add_argument("folder", type=Path, metavar="RUN")
    check.add_argument("--campaign", metavar="FILE", help="expect what this campaign does (default: the run's own)")
    check.add_argument("--junit", type=Path, metavar="FILE", help="write the verdicts as JUnit XML")
    check.add_argument("--markdown", type=Path, metavar="FILE", help="write the verdicts as a markdown table")
    _add_others(add)
    debug = add(subcommands.debug, "render one pose of a run again, and draw what its localizers saw")
    debug.add_argument("folder", type=Path, metavar="RUN")
    debug.add_argument("case", metavar="CASE", help="its key, the beginning of it, or its line in cases.jsonl")
    debug.add_argument("pose", type=int, metavar="POSE", help="its number, as in errors.csv")
