"""The machines of a run, as a profile file states them: never anything that changes what a campaign finds."""

from __future__ import annotations

import ipaddress
from pathlib import Path
from typing import Annotated, Literal
from urllib.parse import urlsplit

from pydantic import (
    BeforeValidator,
    Field,
    FilePath,
    RootModel,
    StringConstraints,
    ValidationInfo,
    field_validator,
    model_validator,
)

from conespot.campaigns.worker import POSE_LIMIT_S
from conespot.scene.document import Document, read_document
from conespot.scene.model import Model
from conespot.scene.quantity import Seconds

#: one line of a job script or of a command: nothing that ends it
Line = Annotated[str, StringConstraints(min_length=1, max_length=1000, pattern=r"^[^\r\n\x00]*$")]
_LOCAL = {"inproc"}  #: protocols that never leave the process
_SECRET = {"tls", "wss"}
_SCHEMES = _LOCAL | _SECRET | {"tcp", "ucx", "ws"}


def _beside(value: object, info: ValidationInfo) -> object:
    """A path as the profile's own folder has it."""
    return Path((info.context or {}).get("folder", ""), value).absolute() if isinstance(value, str) else value


Beside = Annotated[FilePath, BeforeValidator(_beside)]


class Tls(Model):
    """Files of the certificates that scheduler, workers and this command show each other, all signed by `ca_file`."""

    ca_file: Beside
    cert: Beside
    key: Beside


class _Machines(Model):
    #: after which a pose hangs [s]
    pose_limit: Annotated[Seconds, Field(gt=0.0)] = POSE_LIMIT_S
    #: the Mitsuba variant all workers must use; that of the first where it is not stated
    variant: Line = ""


class LocalMachine(_Machines):
    """Dask workers of this machine, reached over loopback alone."""

    kind: Literal["local"]
    workers: Annotated[int, Field(ge=1, le=1024)]
    memory: Line = "auto"  #: of each; a worker that needs more is replaced


class Scheduler(_Machines):
    """Workers of a scheduler that somebody else has started."""

    kind: Literal["scheduler"]
    address: Line
    workers: Annotated[int, Field(ge=1)] = 1  #: how many there are, for the time that a plan promises
    tls: Tls | None = None
    insecure: bool = False

    @model_validator(mode="after")
    def _trusted(self) -> Scheduler:
        parts = urlsplit(self.address)
        try:
            known = parts.scheme in _SCHEMES and bool(parts.netloc) and parts.port != 0
        except ValueError:  # a port that no machine has
            known = False
        if not known:
            raise ValueError(f"address '{self.address}' must be one of Dask's, such as tls://HOST:8786")
        if not (self.insecure or parts.scheme in _LOCAL | _SECRET or _is_loopback(parts.hostname or "")):
            raise ValueError(
                f"{self.address} is neither this machine nor TLS, and whoever reaches Dask's wire can run code at both "
                "its ends; use tls:// with `tls:`, or a profile with `insecure: true` on a network you trust"
            )
        return self


class Jobs(_Machines):
    """Workers that this command submits as jobs of a cluster, as dask-jobqueue writes them."""

    kind: Literal["slurm", "pbs", "sge", "lsf", "htcondor", "moab", "oar"]
    jobs: Annotated[int, Field(ge=1, le=10_000)]
    cores: Annotated[int, Field(ge=1, le=1024)]  #: of a job, each a worker
    memory: Line  #: of a job
    walltime: Line = "01:00:00"
    queue: Line | None = None
    account: Line | None = None
    interface: Line | None = None
    python: Line | None = None
    local_directory: Line | None = None
    log_directory: Line | None = None
    job_extra_directives: tuple[Line, ...] = ()
    job_script_prologue: tuple[Line, ...] = ()
    tls: Tls | None = None
    insecure: bool = False

    @property
    def workers(self) -> int:
        """Workers of all jobs together."""
        return self.jobs * self.cores

    @field_validator("walltime", mode="before")
    @classmethod
    def _clock(cls, value: object) -> object:
        if not isinstance(value, str):
            raise ValueError(f"write a time such as '01:00:00' in quotes, got {value!r}")
        return value

    @model_validator(mode="after")
    def _trusted(self) -> Jobs:
        if self.tls is None and not self.insecure:
            raise ValueError(
                "the workers of jobs are reached over the network, and whoever reaches Dask's wire can run code at "
                "both its ends; state `tls:`, or `insecure: true` on a network you trust"
            )
        return self


Profile = LocalMachine | Scheduler | Jobs


class _File(RootModel[Annotated[Profile, Field(discriminator="kind")]]):
    """What a profile file holds."""


def read_profile(path: str) -> Profile:
    """The profile in a YAML file. Raises InputError with file, line and key."""
    return read_document(Path(path)).validate(_File).root


def scheduler_at(address: str) -> Scheduler:
    """The profile of `--scheduler ADDRESS`. Raises InputError."""
    return Document("--scheduler", {"kind": "scheduler", "address": address}).validate(Scheduler)


def _is_loopback(host: str) -> bool:
    try:
        return host == "localhost" or ipaddress.ip_address(host).is_loopback
    except ValueError:
        return False
