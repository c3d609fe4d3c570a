"""`campaign completion`: what lets bash or zsh complete commands, options, campaigns and files."""

from __future__ import annotations

import argparse
from collections.abc import Iterator
from typing import Literal

import shtab

from conespot.scene.document import shipped

#: of options and arguments that name a file or a folder
_PLACES = {"FILE", "FOLDER", "RUN", "OUT", "SHARD", "ARCHIVE", "FRAMES"}
#: what completes names beside files, by what it completes
_NAMES = {"campaign": "_conespot_campaigns", "scene": "_conespot_scenes"}


def completion(parser: argparse.ArgumentParser, shell: Literal["bash", "zsh"]) -> str:
    """The script for a shell."""
    for action in _actions(parser):
        if own := _NAMES.get(action.dest) if action.nargs != 0 else None:
            vars(action)["complete"] = {"bash": own, "zsh": own}
        elif action.metavar in _PLACES or action.dest == "file":
            vars(action)["complete"] = shtab.FILE
    known = {"campaign": shipped("campaigns", ""), "scene": shipped("scene", "presets")}
    preamble = "\n".join(_function(shell, _NAMES[what], " ".join(names)) for what, names in known.items())
    script: str = shtab.complete(parser, shell, preamble=preamble)
    return script


def _function(shell: Literal["bash", "zsh"], name: str, words: str) -> str:
    if shell == "bash":
        return f'{name}() {{\n  compgen -f -- "$1"\n  compgen -W "{words}" -- "$1"\n}}'
    return f"{name}() {{\n  _files\n  compadd {words}\n}}"


def _actions(parser: argparse.ArgumentParser) -> Iterator[argparse.Action]:
    """The options and arguments of all commands."""
    for action in parser._actions:
        if isinstance(action, argparse._SubParsersAction):
            for command in action.choices.values():
                yield from _actions(command)
        else:
            yield action
