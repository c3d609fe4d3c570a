"""Broken input, a great deal of it: `python benchmarks/fuzz.py`; docs/hostile_input.md has its last result.

1,000 mutations of shipped campaigns and presets, 300 of CSV files, 300 of frames, 100 of run folders, each read in this
process: it is valid, or refused in one sentence of the kind that ends in exit code 2. Anything else is a defect, as is
one that takes 5 s or a process that takes 1 GB. With --command, N of each go through the command as well.
"""

from __future__ import annotations

import argparse
import collections
import random
import resource
import shutil
import subprocess
import sys
import tempfile
import time
import traceback
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parent.parent / "tests" / "cast"))
from mutants import mutated_bytes, mutated_text

from conespot.campaigns.plan import make_plan
from conespot.campaigns.schema import read_campaign
from conespot.render.frame_file import frame_header, read_frame, write_frame
from conespot.results import load_run, write_results
from conespot.scene import InputError, load_scene
from conespot.scene.document import shipped

SLOWEST_S, MOST_MB = 5.0, 1000.0
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


def run_folders(folder: Path, count: int, moment: random.Random, run: Path) -> Made:
    """A run folder with one of its files mutated, lost, a folder, a link, or a pipe."""
    for _ in range(count):
        place = folder / "run"
        shutil.rmtree(place, ignore_errors=True)
        shutil.copytree(run, place)
        path = place / moment.choice(["campaign.yaml", "cases.jsonl", "errors.parquet", "errors.csv", "journal.jsonl"])
        if path.name == "errors.csv":
            (place / "errors.parquet").unlink()
        match moment.randrange(12):
            case 0:
                path.unlink()
            case 1:
                path.unlink()
                path.mkdir()
            case 2:
                path.unlink()
                path.symlink_to(moment.choice(["/dev/zero", "nowhere", path.name, "/etc/passwd"]))
            case _ if path.suffix == ".parquet":
                path.write_bytes(mutated_bytes(path.read_bytes(), moment))
            case _:
                path.write_bytes(mutated_text(path.read_text(), moment))
        yield path, lambda: write_results(folder / "run"), ["report", "run"]


def attempt(read: Callable[[], object]) -> str:
    """`valid`, `refused`, or what the defect was."""
    start = time.process_time()
    try:
        read()
        said = "valid"
    except InputError as error:
        said = "refused" if str(error).isprintable() else f"strange words: {error!r}"
    except Exception as error:
        at = traceback.extract_tb(error.__traceback__)[-1]
        said = f"{type(error).__name__}: {str(error)[:200]} ({Path(at.filename).name}:{at.lineno})"
    took = time.process_time() - start
    return f"took {took:.1f} s" if took > SLOWEST_S else said


def through_command(arguments: list[str], folder: Path) -> str:
    """The same by the command, in a process that may take 5 s of the processor beside its start and 1 GB."""
    command = [sys.executable, "-m", "conespot", *arguments]
    done = subprocess.run(command, cwd=folder, capture_output=True, text=True, timeout=600)
    if done.returncode == 0:
        return "valid"
    sentence = done.stderr.count("\n") == 1 and done.stderr.startswith("campaign: ") and "Traceback" not in done.stderr
    return "refused" if done.returncode == 2 and sentence else f"exit code {done.returncode}: {done.stderr[-200:]}"


def small_run(folder: Path) -> Path:
    """A finished run to damage."""
    text = "scene: {preset: paper-code, camera: {resolution: 100}}\nposes: 3\nsamples: 1\nlocalizers: [paper]\n"
    (folder / "small.yaml").write_text(text)
    command = [sys.executable, "-m", "conespot", "run", "small.yaml", "--workers", "1", "--out", "whole"]
    subprocess.run(command, cwd=folder, check=True, capture_output=True)
    load_run(folder / "whole")
    return folder / "whole"


def main() -> int:
    """Read everything and print what became of it; 1 if there was a defect."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--share", type=float, default=1.0, help="of the counts")
    parser.add_argument("--command", type=int, default=0, metavar="N", help="so many of each through the command")
    options = parser.parse_args()
    bad = 0
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        run = small_run(folder)
        kinds: dict[str, tuple[int, Callable[[int, random.Random], Made]]] = {
            "YAML files": (1000, lambda n, moment: yaml_files(folder, n, moment)),
            "CSV files": (300, lambda n, moment: csv_files(folder, n, moment)),
            "frames": (300, lambda n, moment: frames(folder, n, moment)),
            "run folders": (100, lambda n, moment: run_folders(folder, n, moment, run)),
        }
        for kind, (count, make) in kinds.items():
            ways = {"in process": int(count * options.share), "by command": options.command}
            for way, number in ways.items():
                found: collections.Counter[str] = collections.Counter()
                slowest = 0.0
                for i, (path, read, command) in enumerate(make(number, random.Random(options.seed))):
                    start = time.process_time()
                    if way == "by command" and not command:
                        break
                    said = attempt(read) if way == "in process" else through_command(command, folder)
                    slowest = max(slowest, time.process_time() - start)
                    found["defects" if said not in ("valid", "refused") else said] += 1
                    if said not in ("valid", "refused"):
                        kept = Path(tempfile.gettempdir()) / f"fuzz-{kind.split()[0]}-{options.seed}-{i}{path.suffix}"
                        if path.is_file() and not path.is_symlink():
                            shutil.copy(path, kept)
                        print(f"  {kind} {i}: {said} [{kept}]", flush=True)
                if found:
                    counts = ", ".join(f"{found[word]} {word}" for word in ("valid", "refused", "defects"))
                    print(f"{kind} {way}: {counts}, slowest {slowest:.1f} s", flush=True)
                bad += found["defects"]
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1e3
    print(f"peak memory of this process {peak:.0f} MB")
    return int(bad > 0 or peak > MOST_MB)


if __name__ == "__main__":
    sys.exit(main())
