"""Where the Dask workers come from: a profile becomes a client of their scheduler. Dask is imported here alone.

Dask pickles what it sends, so that whoever reaches its wire can run code at both its ends: profiles allow loopback, TLS
or what the user calls a network to trust.
"""

from __future__ import annotations

import contextlib
import logging
import shutil
import sys
from collections.abc import Iterator
from typing import TYPE_CHECKING, Any, assert_never

from conespot.campaigns.ending import RunError
from conespot.campaigns.profile import Jobs, LocalMachine, Profile, Scheduler, Tls
from conespot.campaigns.worker import born
from conespot.render.kernel import VARIANT_OVERRIDE
from conespot.scene import InputError

if TYPE_CHECKING:
    from dask_jobqueue.core import JobQueueCluster
    from distributed import Client, Security

#: how long a scheduler may take to answer first [s]
_PATIENCE = 20
#: what we ask of a scheduler that we start ourselves: a worker that is lost is our affair at once, a silent one after
#: a minute, one that is replaced imports nothing from the working folder, and logs are for those who look for them
_SETTINGS = {
    "distributed.scheduler.allowed-failures": 0,
    "distributed.scheduler.worker-ttl": "60s",
    "distributed.worker.memory.terminate": 0.95,
    "distributed.nanny.pre-spawn-environ.PYTHONSAFEPATH": "1",
    "distributed.admin.low-level-log-length": 0,
}
_CLUSTERS = {
    "slurm": "SLURMCluster",
    "pbs": "PBSCluster",
    "sge": "SGECluster",
    "lsf": "LSFCluster",
    "htcondor": "HTCondorCluster",
    "moab": "MoabCluster",
    "oar": "OARCluster",
}


@contextlib.contextmanager
def client_of(profile: Profile) -> Iterator[Client]:
    """A client of the profile's scheduler; what we started for it ends with it.

    Raises InputError without Dask, RunError where nothing answers or starts.
    """
    with _installed():
        import dask
        from distributed import Client
    with contextlib.ExitStack() as stack:
        try:
            match profile:
                case Scheduler():
                    where: Any = profile.address
                case LocalMachine() | Jobs():
                    stack.enter_context(dask.config.set(_SETTINGS))
                    where = stack.enter_context(_started(profile))
                case never:
                    assert_never(never)
            tls = None if isinstance(profile, LocalMachine) else profile.tls
            client = stack.enter_context(Client(where, security=security(tls), timeout=_PATIENCE, set_as_default=False))
        except (OSError, RuntimeError, ValueError, TypeError) as error:
            what = profile.address if isinstance(profile, Scheduler) else profile.kind
            said = " ".join(str(error).split())[:300] or type(error).__name__
            raise RunError(f"{what}: no scheduler to work with: {said}") from None
        yield client


def job_script(profile: Jobs) -> str:
    """The script that is submitted for each job. Raises InputError without dask-jobqueue or for options it refuses."""
    with contextlib.closing(_submitter(profile)) as cluster:
        return str(cluster.job_script())


@contextlib.contextmanager
def _started(profile: LocalMachine | Jobs) -> Iterator[object]:
    if isinstance(profile, Jobs):
        with contextlib.closing(_submitter(profile)) as jobs:
            submit = str(jobs.job_cls.submit_command).split()[0]
            if shutil.which(submit) is None:
                raise InputError(f"{profile.kind}: there is no {submit} here; run the command where jobs are submitted")
            jobs.scale(jobs=profile.jobs)
            yield jobs
        return
    from distributed import LocalCluster

    # workers are processes of one thread with a nanny each, which replaces them; whom its thread starts, now or later,
    # never hears of Ctrl-C
    with born():
        cluster = LocalCluster(
            n_workers=profile.workers,
            threads_per_worker=1,
            processes=True,
            memory_limit=profile.memory,
            host="127.0.0.1",
            dashboard_address="127.0.0.1:0",
            silence_logs=logging.CRITICAL,
            env={VARIANT_OVERRIDE: profile.variant} if profile.variant else {},
        )
    with cluster:
        yield cluster


def _submitter(profile: Jobs) -> JobQueueCluster:
    """A scheduler in this process that submits jobs; none yet."""
    with _installed():
        import dask_jobqueue
    # a job begins in the folder where it was submitted, whose files are no modules of its worker
    prologue = [*profile.job_script_prologue, "export PYTHONSAFEPATH=1"]
    if profile.variant:
        prologue.append(f"export {VARIANT_OVERRIDE}={profile.variant}")
    options: dict[str, Any] = {
        "cores": profile.cores,
        "processes": profile.cores,
        "memory": profile.memory,
        "walltime": profile.walltime,
        "interface": profile.interface,
        "python": profile.python or sys.executable,
        "local_directory": profile.local_directory,
        "log_directory": profile.log_directory,
        "job_extra_directives": list(profile.job_extra_directives),
        "job_script_prologue": prologue,
        "security": security(profile.tls),
        "scheduler_options": {"dashboard_address": "127.0.0.1:0"},
    }
    options |= {k: v for k, v in {"queue": profile.queue, "account": profile.account}.items() if v is not None}
    if profile.kind == "htcondor":  # which has neither, and states a job's disk
        options |= {"disk": "1 GB"}
        del options["walltime"]
    try:
        cluster: JobQueueCluster = getattr(dask_jobqueue, _CLUSTERS[profile.kind])(**options)
    except (ValueError, TypeError) as error:
        raise InputError(f"{profile.kind}: {' '.join(str(error).split())[:300]}") from None
    return cluster


def security(tls: Tls | None) -> Security | None:
    """The certificates that a profile states; without that, Dask's own configuration has its say."""
    if tls is None:
        return None
    from distributed import Security

    files = {"cert": str(tls.cert), "key": str(tls.key)}
    roles = {f"tls_{role}_{name}": file for role in ("client", "scheduler", "worker") for name, file in files.items()}
    return Security(tls_ca_file=str(tls.ca_file), require_encryption=True, **roles)


@contextlib.contextmanager
def _installed() -> Iterator[None]:
    try:
        yield
    except ImportError as error:
        raise InputError(f"Dask is not installed ({error}): pip install 'conespot[distributed]'") from None
