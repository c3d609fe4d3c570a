"""`campaign completion`: what lets bash or zsh complete commands, options, campaigns and files."""

from __future__ import annotations

import argparse
from collections.abc import Iterator
from typing import Literal

import shtab

from conespot.scene.document import shipped

#: of options and arguments that name a file or a folder
_PLACES = {"FILE", "FOLDER", "RUN", "OUT", "SHARD", "ARCHIVE", "FRAMES"}
_OWN = "_conespot_campaigns"


def completion(parser: argparse.ArgumentParser, shell: Literal["bash", "zsh"]) -> str:
    """The script for a shell."""
    names = " ".join(shipped("campaigns", ""))
    preamble = {
        "bash": f'{_OWN}() {{\n  compgen -f -- "$1"\n  compgen -W "{names}" -- "$1"\n}}',
        "zsh": f"{_OWN}() {{\n  _files\n  compadd {names}\n}}",
    }
    for action in _actions(parser):
        if action.dest == "campaign":
            vars(action)["complete"] = {"bash": _OWN, "zsh": _OWN}
        elif action.metavar in _PLACES or action.dest in ("file", "scene"):
            vars(action)["complete"] = shtab.FILE
    script: str = shtab.complete(parser, shell, preamble=preamble[shell])
    return script


def _actions(parser: argparse.ArgumentParser) -> Iterator[argparse.Action]:
    """The options and arguments of all commands."""
    for action in parser._actions:
        if isinstance(action, argparse._SubParsersAction):
            for command in action.choices.values():
                yield from _actions(command)
        else:
            yield action
