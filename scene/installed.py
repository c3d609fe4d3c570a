"""What other installed packages offer by entry points: found by name, and loaded when first asked for."""

from __future__ import annotations

import functools
import re
from importlib.metadata import EntryPoint, entry_points

from conespot.scene.document import InputError

#: what the rows of a run can hold
_NAME = re.compile(r"[\w.+-]{1,60}", re.ASCII)
_LONGEST = 500


@functools.cache
def offered(group: str) -> dict[str, EntryPoint]:
    """Every entry point of a group, by name and not yet loaded; of equal names the first found."""
    found: dict[str, EntryPoint] = {}
    for entry in entry_points(group=group):
        if _NAME.fullmatch(entry.name):
            found.setdefault(entry.name, entry)
    return dict(sorted(found.items()))


def described(entry: EntryPoint) -> str:
    """The entry point for people: its name, what it loads, and the package that offers it."""
    package = "" if entry.dist is None else f" of {entry.dist.name} {entry.dist.version}"
    return f"'{entry.name}' ({entry.value}{package})"


def loaded(entry: EntryPoint, what: str) -> object:
    """The object of an entry point, a `what`. Raises InputError, naming the package, if it cannot be loaded."""
    try:
        value: object = entry.load()
    except (Exception, SystemExit) as error:
        raise InputError(
            f"{what} {described(entry)} cannot be loaded: {sentence(error)}; mend or uninstall that package"
        ) from None
    return value


def sentence(error: BaseException) -> str:
    """An error of somebody else's code in one line."""
    return f"{type(error).__name__}: {' '.join(str(error).split())[:_LONGEST]}".rstrip(": ")
