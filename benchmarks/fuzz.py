"""Broken input, a great deal of it: `python benchmarks/fuzz.py`; docs/hostile_input.md has its last result.

1,000 mutations of shipped campaigns and presets, 300 of CSV files, 300 of frames, 300 images and videos from outside,
100 run folders, each read in this process: it is valid, or refused in one sentence of the kind that ends in exit code
2. Anything else is a defect, as is one that takes 5 s by the clock, waiting or working, or 1 GB. With --command, N of
each go through the command as well, each in a process of its own, whose start counts too; none reads a run's frame.
"""

from __future__ import annotations

import argparse
import collections
import contextlib
import faulthandler
import os
import random
import resource
import shutil
import signal
import subprocess
import sys
import tempfile
import threading
import time
import traceback
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parent.parent / "tests" / "cast"))
from mutants import mutated_bytes, mutated_text
from strangers_frames import scene_of, settings_of, strangers_file

from conespot.campaigns.plan import make_plan
from conespot.campaigns.schema import read_campaign
from conespot.localize.frames.reader import read_frames
from conespot.render.frame_file import frame_header, read_frame, write_frame
from conespot.results import load_run, write_results
from conespot.scene import InputError, load_scene
from conespot.scene.document import shipped

SLOWEST_S, MOST_MB = 5.0, 1000.0
#: addresses that a process may ask for [bytes]: what asks for more is refused by the system before it hurts the machine
CEILING = 8_000_000_000
#: what looks at a run folder that somebody else has made
LOOKS = (["report", "run"], ["status", "run"], ["check", "run"])
_CSV = {
    "trajectory: {kind: csv, file: x.csv}": "x_mm,y_mm,z_mm\n"
    + "".join(f"{i / 9},{-i / 7},{4 + i / 30}\n" for i in range(20)),
    "scene: {illumination: {kind: csv, file: x.csv}}": "nm;power\n"
    + "".join(f"{500 + i};{i % 7},5\n" for i in range(30)),
    "scene: {surface: {height_map: {kind: csv, file: x.csv, width: 4 mm}}}": "1,2,3,4,5\n" * 6,
}  # fmt: skip

Made = Iterator[tuple[Path, Callable[[], object], list[str]]]


def yaml_files(folder: Path, count: int, moment: random.Random) -> Made:
    """Mutated campaigns and presets: the path, how it is read in this process, and the command that reads it."""
    campaigns, presets = shipped("campaigns", ""), shipped("scene", "presets")
    for _ in range(count):
        path = folder / "x.yaml"
        if moment.random() < 0.25:
            path.write_bytes(mutated_text(moment.choice(list(presets.values())).read_text(), moment))
            (folder / "c.yaml").write_text("scene: x.yaml\nposes: 2\n")
            yield path, lambda: load_scene(folder / "x.yaml"), ["validate", "c.yaml"]
        else:
            path.write_bytes(mutated_text(moment.choice(list(campaigns.values())).read_text(), moment))
            yield path, lambda: make_plan(read_campaign(str(folder / "x.yaml"))), ["validate", "x.yaml"]


def csv_files(folder: Path, count: int, moment: random.Random) -> Made:
    """Mutated trajectories, spectra and height maps."""
    for _ in range(count):
        key = moment.choice(list(_CSV))
        (folder / "x.csv").write_bytes(mutated_text(_CSV[key], moment))
        start = key if key.startswith("scene") else f"scene: paper-code\n{key}"
        (folder / "c.yaml").write_text(f"{start}\nposes: 2\n")
        yield folder / "x.csv", lambda: make_plan(read_campaign(str(folder / "c.yaml"))), ["validate", "c.yaml"]


def frames(folder: Path, count: int, moment: random.Random) -> Made:
    """Mutated EXR frames; no command reads one."""
    scene = load_scene("paper-code")
    image = np.random.default_rng(1).random((40, 40, 3), np.float32)
    write_frame(folder / "whole.exr", image, frame_header(scene, scene.pose(np.array([0.0, 0.0, 4.0])), 1.0, {}))
    whole = (folder / "whole.exr").read_bytes()
    for _ in range(count):
        head = moment.random() < 0.5  # where sizes and types stand
        broken = mutated_bytes(whole[:400], moment) + whole[400:] if head else mutated_bytes(whole, moment)
        (folder / "x.exr").write_bytes(broken)
        yield folder / "x.exr", lambda: read_frame(folder / "x.exr"), []


def strangers_frames(folder: Path, count: int, moment: random.Random) -> Made:
    """Images and videos from outside: broken, cut off, mislabelled, huge, of another scene, or none at all."""
    for _ in range(count):
        path, name = strangers_file(folder, moment)
        written = folder / "x.csv"
        command = ["localize", str(path), "--scene", "paper", *settings_of(name), "--csv", written.name]
        yield path, lambda path=path, name=name: list(read_frames([path], scene_of(name))), command
        written.unlink(missing_ok=True)
        assert not list(folder.glob(".*.tmp")), "something was left half-written"


def run_folders(folder: Path, count: int, moment: random.Random, run: Path) -> Made:
    """A run folder with one of its files mutated, lost, a folder, a link, or a pipe."""
    files = ["campaign.yaml", "cases.jsonl", "errors.parquet", "errors.csv", "journal.jsonl", "progress.json"]
    for i in range(count):
        place = folder / "run"
        shutil.rmtree(place, ignore_errors=True)
        shutil.copytree(run, place)
        path = place / moment.choice(files)
        if path.name == "errors.csv":
            (place / "errors.parquet").unlink()
        if path.name != "journal.jsonl" and moment.random() < 0.5:  # then rows are believed
            (place / "journal.jsonl").unlink()
        match moment.randrange(12):
            case 0:
                path.unlink()
            case 1:
                path.unlink()
                path.mkdir()
            case 2:
                path.unlink()
                path.symlink_to(moment.choice(["/dev/zero", "nowhere", path.name, "/etc/passwd"]))
            case 3:
                path.unlink()
                os.mkfifo(path)
            case _ if path.suffix == ".parquet":
                path.write_bytes(mutated_bytes(path.read_bytes(), moment))
            case _:
                path.write_bytes(mutated_text(path.read_text(), moment))
        yield path, lambda: write_results(folder / "run"), LOOKS[i % len(LOOKS)]


class TooLongError(BaseException):
    """Not an Exception, which the code that is tried may catch."""


@contextlib.contextmanager
def stopped_after(seconds: float) -> Iterator[None]:
    """Raises TooLongError where this process then is, waiting or working; in C code that never returns, ends it."""

    def stop(*_: object) -> None:
        raise TooLongError

    signal.signal(signal.SIGALRM, stop)
    faulthandler.dump_traceback_later(seconds + 60, exit=True)
    signal.setitimer(signal.ITIMER_REAL, seconds)
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0)
        faulthandler.cancel_dump_traceback_later()


def in_process(read: Callable[[], object], seconds: float) -> tuple[str, float]:
    """`valid`, `refused`, or what the defect was; and the most memory that this process ever held [MB]."""
    try:
        with stopped_after(seconds):
            read()
        said = "valid"
    except InputError as error:
        said = "refused" if str(error).isprintable() else f"strange words: {error!r}"
    except TooLongError as error:
        at = traceback.extract_tb(error.__traceback__)[-2]
        said = f"took longer than {seconds:g} s ({Path(at.filename).name}:{at.lineno})"
    except Exception as error:
        at = traceback.extract_tb(error.__traceback__)[-1]
        said = f"{type(error).__name__}: {str(error)[:200]} ({Path(at.filename).name}:{at.lineno})"
    return said, most_memory()


def most_memory() -> float:
    """What this process held at most [MB]; `getrusage` would count what its parent held when it started it."""
    status = Path("/proc/self/status")
    if status.exists():
        line = next(line for line in status.read_text().splitlines() if line.startswith("VmHWM:"))
        return int(line.split()[1]) * 1024 / 1e6
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024 / 1e6


def by_command(arguments: list[str], folder: Path, seconds: float) -> tuple[str, float]:
    """The same of the command, which is killed when its time is over; and the most memory that it held [MB]."""
    with tempfile.TemporaryFile("w+") as words:
        command = [sys.executable, "-m", "conespot", *arguments]
        process = subprocess.Popen(
            command, cwd=folder, stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL, stderr=words
        )
        timer = threading.Timer(seconds, process.kill)
        timer.start()
        _, status, used = os.wait4(process.pid, 0)  # which says what this process used, not the largest of all
        timer.cancel()
        code = process.returncode = os.waitstatus_to_exitcode(status)
        words.seek(0)
        lines = words.read().splitlines()
    peak = used.ru_maxrss * 1024 / 1e6
    name, last = arguments[0], lines[-1] if lines else ""
    if code == -signal.SIGKILL:
        return f"{name} took longer than {seconds:g} s", peak
    traced = any(line.startswith("Traceback") for line in lines)
    missed = name == "check" and code == 1 and last.startswith("campaign: ") and "expectations missed" in last
    missed |= name == "localize" and code == 1 and len(lines) == 1 and "frames refused" in last  # it could be read
    if not traced and (code == 0 or missed):
        return "valid", peak
    # `report` names the damaged lines of a journal before it ends, `check` what was missed
    refused = code == 2 and last.startswith("campaign: ") and (len(lines) == 1 or name in ("report", "check"))
    return "refused" if refused and not traced else f"{name}: exit code {code}: {lines[-3:]}", peak


def small_run(folder: Path) -> Path:
    """A finished run to damage."""
    text = "scene: {preset: paper-code, camera: {resolution: 100}}\nposes: 3\nsamples: 1\nlocalizers: [paper]\n"
    text += "expect: [{metric: failed share, at_most: 1}]\n"
    (folder / "small.yaml").write_text(text)
    command = [sys.executable, "-m", "conespot", "run", "small.yaml", "--workers", "1", "--out", "whole"]
    subprocess.run(command, cwd=folder, check=True, capture_output=True)
    load_run(folder / "whole")
    return folder / "whole"


def count(kind: str, way: str, made: Made, folder: Path, seed: int, seconds: float) -> int:
    """Try them all, print what became of them, and return how many defects there were."""
    found: collections.Counter[str] = collections.Counter()
    slowest = most = 0.0
    for i, (path, read, command) in enumerate(made):
        if way == "by command" and not command:
            return 0
        start = time.perf_counter()
        said, peak = in_process(read, seconds) if way == "in process" else by_command(command, folder, seconds)
        slowest = max(slowest, time.perf_counter() - start)
        if peak > MOST_MB >= most:
            said = f"took {peak:.0f} MB"
        most = max(most, peak)
        defect = said not in ("valid", "refused")
        found["defects" if defect else said] += 1
        if defect:
            kept = Path(tempfile.gettempdir()) / f"fuzz-{kind.split()[0]}-{seed}-{i}{path.suffix}"
            if path.is_file() and not path.is_symlink():
                shutil.copy(path, kept)
            print(f"  {kind} {i}: {said} [{kept}]", flush=True)
    counts = ", ".join(f"{found[word]} {word}" for word in ("valid", "refused", "defects"))
    print(f"{kind} {way}: {counts}, slowest {slowest:.1f} s, most {most:.0f} MB", flush=True)
    return found["defects"]


def main() -> int:
    """Read everything and print what became of it; 1 if there was a defect."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--share", type=float, default=1.0, help="of the counts")
    parser.add_argument("--command", type=int, default=0, metavar="N", help="so many of each through the command")
    parser.add_argument("--seconds", type=float, default=SLOWEST_S, help="that one may take (default: 5)")
    options = parser.parse_args()
    bad = 0
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        run = small_run(folder)
        resource.setrlimit(resource.RLIMIT_AS, (CEILING, CEILING))
        kinds: dict[str, tuple[int, Callable[[int, random.Random], Made]]] = {
            "YAML files": (1000, lambda n, moment: yaml_files(folder, n, moment)),
            "CSV files": (300, lambda n, moment: csv_files(folder, n, moment)),
            "frames": (300, lambda n, moment: frames(folder, n, moment)),
            "images and videos": (300, lambda n, moment: strangers_frames(folder, n, moment)),
            "run folders": (100, lambda n, moment: run_folders(folder, n, moment, run)),
        }
        for kind, (most, make) in kinds.items():
            ways = {"in process": int(most * options.share), "by command": options.command}
            for way, number in ways.items():
                if number:
                    made = make(number, random.Random(options.seed))
                    bad += count(kind, way, made, folder, options.seed, options.seconds)
    return int(bad > 0)


if __name__ == "__main__":
    sys.exit(main())
