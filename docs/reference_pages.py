"""The reference of YAML keys, made from the models, and of the command line, made from its parser."""

from __future__ import annotations

import argparse
from collections.abc import Iterator

from pydantic import BaseModel

from conespot.campaigns.command_line import parser
from conespot.campaigns.key_paths import Key, keys_of
from conespot.campaigns.key_words import bounds_words, default_words, kind_of
from conespot.campaigns.schema import Campaign
from conespot.scene.keys import meaning, summary

_LONGEST = 60


def keys_page() -> str:
    """The keys of campaigns and scenes: a table for each description, with the paths that lead to it."""
    return "\n".join(_keys_lines())


def _keys_lines() -> Iterator[str]:
    yield "# YAML keys"
    yield ""
    yield "Made from the program's own models. `campaign explain KEY` says the same of one key, with what the presets"
    yield "have; `campaign schema` prints it as JSON Schema, with which editors complete and check a file. A quantity"
    yield "is written with its unit (`9 deg`, `0.25 W`), and a key is set in a sweep or by `--set` by its dotted path."
    where: dict[type[BaseModel], list[str]] = {Campaign: []}
    for key in keys_of(Campaign):
        paths = where.setdefault(key.model, [])
        if (path := ".".join(key.path[:-1])) not in paths:
            paths.append(path)
    for model, paths in where.items():
        kind = kind_of(model)
        title = " and ".join(f"`{path}`" for path in paths if path) or "The campaign"
        yield f"\n## {title}{f', kind `{kind}`' if kind else ''}\n"
        yield f"{summary(model)}.\n"
        yield "| key | means | default | allowed | source |\n|---|---|---|---|---|"
        for name in model.model_fields:
            key, said = Key((name,), model, False), meaning(model, name)
            unit = f" [{said.unit}]" if said.unit else ""
            cells = (f"`{name}`", said.means + unit, _code(default_words(key)), bounds_words(key), said.source)
            yield "| " + " | ".join(cell.replace("|", "\\|") for cell in cells) + " |"
    yield ""


def _code(text: str) -> str:
    return f"`{text if len(text) <= _LONGEST else text[: _LONGEST - 4] + ' ...'}`"


def command_page() -> str:
    """The commands and their options, as `--help` prints them."""
    line = parser()
    parts = ["# Command line\n", "Made from the program's own parser.\n", _help(line)]
    for action in line._actions:
        if isinstance(action, argparse._SubParsersAction):
            for name, command in action.choices.items():
                parts += [f"## campaign {name}\n", _help(command)]
    return "\n".join(parts)


def _help(command: argparse.ArgumentParser) -> str:
    return f"```text\n{command.format_help().rstrip()}\n```\n"


PAGES = {"keys": keys_page, "command_line": command_page}
