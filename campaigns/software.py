"""What measures: versions of all that an answer may depend on, and a digest of this package's own source."""

from __future__ import annotations

import contextlib
import functools
import hashlib
import importlib.metadata
import os
from importlib import resources
from pathlib import Path

from conespot.campaigns.maker import PACKAGES


@functools.cache
def software() -> dict[str, str]:
    """Versions by package, of those that are installed, and the digest of the source of conespot itself.

    Two checkouts may state the same version and be different programs, which the digest tells.
    """
    found = {}
    for package in PACKAGES:
        with contextlib.suppress(importlib.metadata.PackageNotFoundError):
            found[package] = importlib.metadata.version(package)
    return found | {"conespot source": _source_digest(Path(str(resources.files("conespot"))))}


def _source_digest(root: Path) -> str:
    digest = hashlib.sha256()
    # the rooms are links in a checkout
    for folder, below, files in os.walk(root, followlinks=True):
        below.sort()
        for name in sorted(name for name in files if name.endswith(".py")):
            path = Path(folder, name)
            digest.update(f"{path.relative_to(root)}\n".encode())
            digest.update(path.read_bytes())
    return digest.hexdigest()[:12]
