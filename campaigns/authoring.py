"""What the commands do that help to write a campaign. Everything heavy is imported where it is used."""

from __future__ import annotations

from conespot.campaigns import streams
from conespot.campaigns.ending import Ending

TYPE_CHECKING = False  # `typing` takes long to import
if TYPE_CHECKING:
    import argparse


def init(options: argparse.Namespace) -> Ending:
    """Write a campaign, or a microscope's scene, from a few answers."""
    from pathlib import Path

    from conespot.campaigns import new_campaign, new_microscope
    from conespot.campaigns.questions import answers, refuse_answers, say_unasked

    if options.microscope:
        refuse_answers(options, new_campaign.QUESTIONS, "campaign; leave --microscope out")
        path = options.file or Path("my_microscope.yaml")
        new_microscope.write_microscope(path, answers(options, new_microscope.QUESTIONS))
        say_unasked(options, new_microscope.QUESTIONS)
        streams.say(f"{path}: next: campaign localize FRAMES --scene {path}")
        return Ending.DONE
    refuse_answers(options, new_microscope.QUESTIONS, "microscope; add --microscope")
    options.file = options.file or Path("my_campaign.yaml")
    rows = new_campaign.write_campaign(options.file, answers(options, new_campaign.QUESTIONS))
    say_unasked(options, new_campaign.QUESTIONS)
    streams.say(f"{options.file}: {rows} rows; next: campaign plan {options.file}")
    return Ending.DONE


def preview(options: argparse.Namespace) -> Ending:
    """Draw one frame of a campaign, and its set-up."""
    from conespot.campaigns.preview import preview
    from conespot.campaigns.settings import document_of

    streams.say(preview(document_of(options), options.out))
    return Ending.DONE


def explain(options: argparse.Namespace) -> Ending:
    """Say what a key means."""
    from conespot.campaigns.explain import explain

    for line in explain(options.key):
        streams.say(line)
    return Ending.DONE


def schema(options: argparse.Namespace) -> Ending:
    """Print a JSON Schema."""
    import json

    from conespot.campaigns.json_schema import campaign_schema, scene_schema

    streams.say(json.dumps(scene_schema() if options.scene else campaign_schema(), indent=1))
    return Ending.DONE


def completion(options: argparse.Namespace) -> Ending:
    """Print a shell's completion."""
    from conespot.campaigns.command_line import parser
    from conespot.campaigns.completion import completion

    streams.write(completion(parser(), options.shell))
    return Ending.DONE


def list(options: argparse.Namespace) -> Ending:
    """List campaigns, or localizers."""
    if options.localizers:
        from conespot.localize.locate import in_words

        for line in in_words():
            streams.say(line)
        return Ending.DONE
    from conespot.scene.document import read_document, shipped

    for name, path in shipped("campaigns", "").items():
        streams.say(f"{name:16} {read_document(path).data.get('description', '')}")
    return Ending.DONE


def show(options: argparse.Namespace) -> Ending:
    """Print the file of a campaign, or of a scene preset."""
    from conespot.scene.document import find_document, read_document, shipped

    preset = shipped("scene", "presets").get(options.campaign)
    path = preset or find_document(options.campaign, "campaigns", "", "campaign")
    read_document(path)  # no control characters reach a terminal
    streams.write(path.read_text("utf-8-sig"))
    return Ending.DONE
