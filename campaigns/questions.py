"""Questions of `campaign init`: asked on a terminal, answered by an option or by their default anywhere else."""

from __future__ import annotations

import difflib
import os
import sys

from conespot.campaigns import streams

TYPE_CHECKING = False  # `typing` takes long to import
if TYPE_CHECKING:
    import argparse
    from collections.abc import Callable, Iterable, Mapping
    from pathlib import Path
    from typing import TypeVar

    from conespot.scene.document import Document

    Read = TypeVar("Read")
    #: an answer as it is written; raises ValueError, saying how to answer instead
    Check = Callable[[str], str]
    #: what is answered by nothing but Enter, or made of the answers so far
    Default = str | Callable[[Mapping[str, str]], str]


class Question:
    """What is asked (`text`), the option that answers it (`name`), and what is understood: `check`, or `choices`.

    Several answers, if they are taken, are separated by commas.
    """

    def __init__(
        self,
        name: str,
        text: str,
        default: Default,
        *,
        metavar: str = "NAME",
        check: Check | None = None,
        choices: Callable[[], Iterable[str]] | None = None,
        several: bool = False,
    ) -> None:
        self.name, self.metavar = name, "A,B" if several else metavar
        self.text = f"{text}; several are compared" if several else text
        self.choices = choices
        self._default, self._check, self._several = default, check, several

    def default(self, so_far: Mapping[str, str]) -> str:
        """What Enter alone answers, after those answers."""
        return self._default if isinstance(self._default, str) else self._default(so_far)

    def understood(self, answer: str) -> str:
        """The answer as it is written. Raises ValueError, saying how to answer instead."""
        parts = answer.split(",") if self._several else [answer]
        return ", ".join(dict.fromkeys(self._one(part.strip()) for part in parts))

    def _one(self, answer: str) -> str:
        if self._check is not None:
            return self._check(answer)
        names = list(self.choices() if self.choices is not None else ())
        if names and answer not in names:
            near = difflib.get_close_matches(answer, names, n=1)
            hint = f"did you mean '{near[0]}'?" if near else f"answer one of {', '.join(names)}"
            raise ValueError(f"'{answer}' is none of the answers; {hint}")
        return answer


def add_questions(command: argparse.ArgumentParser, questions: Iterable[Question], title: str) -> None:
    """Let a command have an option for each question, under a title."""
    group = command.add_argument_group(title)
    for question in questions:
        group.add_argument(f"--{question.name}", metavar=question.metavar, help=question.text)


def answers(options: argparse.Namespace, questions: Iterable[Question]) -> dict[str, str]:
    """The answer to every question, in their order: its option, else asked on a terminal, else its default.

    Raises InputError for an option, or a default, that is none.
    """
    from conespot.scene.document import InputError

    found: dict[str, str] = {}
    people = _people(options)
    for question in questions:
        given = getattr(options, question.name.replace("-", "_"))
        if given is None and people:
            found[question.name] = _asked(question, question.default(found))
            continue
        try:
            found[question.name] = question.understood(question.default(found) if given is None else given)
        except ValueError as error:
            raise InputError(f"--{question.name}: {error}") from None
    return found


def say_unasked(options: argparse.Namespace, questions: Iterable[Question]) -> None:
    """Say on stderr how many questions took their default because nobody could be asked, and nobody said so."""
    silent = [q for q in questions if getattr(options, q.name.replace("-", "_")) is None]
    if silent and not options.defaults and not _people(options):
        streams.complain(
            f"there is no terminal to ask on, so {len(silent)} questions took their defaults; read the file, or answer"
            " by options"
        )


def _people(options: argparse.Namespace) -> bool:
    """Whether somebody can be asked, and wants to be."""
    return not options.defaults and sys.stdin.isatty() and sys.stderr.isatty()


def refuse_answers(options: argparse.Namespace, questions: Iterable[Question], what: str) -> None:
    """Raises InputError for an option that answers a question of something else, which is `what` in words."""
    from conespot.scene.document import InputError

    for question in questions:
        if getattr(options, question.name.replace("-", "_")) is not None:
            raise InputError(f"--{question.name}: is asked of a {what}")


def _asked(question: Question, default: str) -> str:
    """What a person answers, asked again until it is understood."""
    if question.choices is not None:
        streams.complain(f"  ({', '.join(question.choices())})")
    while True:
        sys.stderr.write(f"{question.text} [{default}]: ")
        sys.stderr.flush()
        line = sys.stdin.readline()
        if not line:
            raise KeyboardInterrupt  # Ctrl-D: nothing is written
        try:
            return question.understood(line.strip() or default)
        except ValueError as error:
            streams.complain(f"  {error}")


def write_answered(path: Path, lines: Iterable[str], read: Callable[[Document], Read]) -> Read:
    """Write the lines that answers make to a new file; what `read` makes of them, which refuses what is not valid.

    Raises InputError, with nothing written, if the file is there, cannot be written, or the answers do not go together.
    """
    from conespot.scene.atomic import write_atomically
    from conespot.scene.document import Document, InputError, read_value

    if os.path.lexists(path):
        raise InputError(f"{path}: is there already; name another file")
    if not path.parent.is_dir():
        raise InputError(f"{path.parent}: no such folder; make it, or name another file")
    text = "".join(f"{line}\n" for line in lines)
    found = read(Document("these answers", read_value(text, "these answers"), folder=path.parent))
    write_atomically(path, text.encode(), "file")
    return found
