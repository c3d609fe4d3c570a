"""What libraries say on their own, past whoever calls them: kept from the user, who gets one sentence."""

from __future__ import annotations

import contextlib
import io
import os
import tempfile
from collections.abc import Iterator


class Heard:
    """What was said; complete when it is over."""

    text: str = ""


@contextlib.contextmanager
def hushed() -> Iterator[Heard]:
    """Keeps for a while what Python code prints and what C code writes to stderr; it is in `text` afterwards, cut."""
    heard, printed = Heard(), io.StringIO()
    with tempfile.TemporaryFile() as written, contextlib.redirect_stdout(printed), _elsewhere(2, written.fileno()):
        yield heard
        written.seek(0)
        heard.text = " ".join(f"{written.read(4096).decode(errors='replace')} {printed.getvalue()[:4096]}".split())


@contextlib.contextmanager
def _elsewhere(stream: int, to: int) -> Iterator[None]:
    """Lets a stream of the process lead to another file, if there is such a stream."""
    try:
        kept = os.dup(stream)
    except OSError:
        yield
        return
    os.dup2(to, stream)
    try:
        yield
    finally:
        os.dup2(kept, stream)
        os.close(kept)
