"""The options of the command that say what a campaign does: keys of its file, which they win over."""

from __future__ import annotations

import argparse
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from conespot.scene.document import Document

#: options that set a key of the campaign
_SETTINGS = {
    "resolution": ("scene.camera.resolution", "PX", "pixels a side of a frame, or 1920x1080"),
    "poses": ("poses", "N", "poses of each trajectory"),
    "samples": ("samples", "N", "rendering samples a pixel"),
    "seed": ("seed", "N", "seed of every random number"),
    "localizers": ("localizers", "A,B", "localizers to use"),
}


def add_set(command: argparse.ArgumentParser) -> None:
    """Let a command have `--set` for any key."""
    command.add_argument(
        "--set",
        action="append",
        default=[],
        metavar="KEY=VALUE",
        help="set a key, such as scene.eye.radius='12 mm'",
    )


def add_settings(command: argparse.ArgumentParser) -> None:
    """Let a command have an option for each key that is set often."""
    for name, (_, metavar, text) in _SETTINGS.items():
        command.add_argument(f"--{name}", metavar=metavar, help=text)


def document_of(options: argparse.Namespace) -> Document:
    """The campaign's file with the settings of the command line on it."""
    from conespot.campaigns.schema import override, read_campaign, setting

    document = read_campaign(options.campaign)
    for name, (key, _, _) in _SETTINGS.items():
        value = getattr(options, name)
        if value is not None:
            text = f"[{value}]" if name == "localizers" else value
            document = override(document, key, text, f"--{name}")
    for text in options.set:
        key, value = setting(text)
        document = override(document, key, value, f"--set {key}")
    return document
