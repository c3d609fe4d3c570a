"""The options of the command that say where a campaign is measured, and how much of it: never what it finds."""

from __future__ import annotations

import argparse
import os
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from conespot.campaigns.executor import Executor
    from conespot.campaigns.profile import Profile
    from conespot.campaigns.shard import Shard

_MOST_WORKERS = 1024


def add_machines(command: argparse.ArgumentParser) -> None:
    """Let a command have `--workers`, or `--scheduler` or `--profile` in their place."""
    where = command.add_mutually_exclusive_group()
    add_workers(where)
    where.add_argument("--scheduler", metavar="ADDRESS", help="work on the Dask workers of tls://HOST:PORT instead")
    where.add_argument("--profile", metavar="FILE", help="work on the machines that a YAML file describes instead")


def add_workers(command: argparse._ActionsContainer) -> None:
    """Let a command have `--workers`."""
    command.add_argument("--workers", metavar="N", type=_workers, default=_cores(), help="processes (default: cores)")


def few(text: str) -> int:
    """A whole number from 0 to 100, as the command line has it."""
    if not (text.isdecimal() and int(text) <= 100):
        raise argparse.ArgumentTypeError("must be a whole number from 0 to 100")
    return int(text)


def profile_of(options: argparse.Namespace) -> Profile | None:
    """The machines of the command line; None for the processes of this one. Raises InputError."""
    if not (options.profile or options.scheduler):
        return None
    from conespot.campaigns.profile import read_profile, scheduler_at

    return read_profile(options.profile) if options.profile else scheduler_at(options.scheduler)


def executor_of(options: argparse.Namespace) -> Executor:
    """Who works the plan off. Raises InputError."""
    profile = profile_of(options)
    if profile is not None:
        from conespot.campaigns.dask_cluster import DaskCluster

        return DaskCluster(profile)
    from conespot.campaigns.pool import LocalPool

    return LocalPool(options.workers)


def jobs_in_words(profile: Profile | None) -> str:
    """The jobs that a run would submit, with their script; nothing for machines that need none."""
    if profile is None or profile.kind == "local" or profile.kind == "scheduler":
        return ""
    from conespot.campaigns.cluster import job_script

    return f"{profile.jobs} jobs of this script:\n{job_script(profile)}"


def shard_of(options: argparse.Namespace) -> Shard | None:
    """The share that is asked for. Raises InputError."""
    if not options.shard:
        return None
    from conespot.campaigns.shard import Shard

    return Shard.of(options.shard)


def _workers(text: str) -> int:
    count = int(text) if text.isdecimal() else 0
    if not 1 <= count <= _MOST_WORKERS:
        raise argparse.ArgumentTypeError(f"must be a whole number from 1 to {_MOST_WORKERS}")
    return count


def _cores() -> int:
    # a cluster gives a job fewer cores than the machine has
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
