"""Runs a command and says its wall time, its processor time and the memory of it and all it started, in Linux.

`python benchmarks/measured.py campaign run power_sweep --out /tmp/run`. Memory is the sum of the proportional set sizes
of all processes at its peak, sampled twice a second: a page that two share counts once.
"""

from __future__ import annotations

import contextlib
import os
import subprocess
import sys
import time
from pathlib import Path


def family(root: int) -> set[int]:
    """The process and all its descendants."""
    parents: dict[int, int] = {}
    for path in Path("/proc").glob("[0-9]*"):
        with contextlib.suppress(OSError, IndexError, ValueError):
            # the name in parentheses may hold anything
            parents[int(path.name)] = int((path / "stat").read_text().rsplit(")", 1)[1].split()[1])
    found = {root}
    while True:
        more = {pid for pid, parent in parents.items() if parent in found} - found
        if not more:
            return found
        found |= more


def proportional_set_size(pid: int) -> int:
    """Bytes of a process, each page divided by how many share it; 0 when it is gone."""
    with contextlib.suppress(OSError):
        for line in Path(f"/proc/{pid}/smaps_rollup").read_text().splitlines():
            if line.startswith("Pss:"):
                return 1024 * int(line.split()[1])
    return 0


def main() -> int:
    """Run the rest of the command line."""
    before = os.times()
    start = time.perf_counter()
    process = subprocess.Popen(sys.argv[1:])
    peak = 0
    while process.poll() is None:
        peak = max(peak, sum(map(proportional_set_size, family(process.pid))))
        time.sleep(0.5)
    wall = time.perf_counter() - start
    used = os.times()
    user, system = used.children_user - before.children_user, used.children_system - before.children_system
    print(f"{wall:.1f} s, {user:.1f} s of processor time and {system:.1f} s in the system, {peak / 1e6:.0f} MB")
    return process.returncode


if __name__ == "__main__":
    sys.exit(main())
