"""The commands of `campaign` for other people's methods. Everything heavy is imported where it is used."""

from __future__ import annotations

from conespot.campaigns import streams
from conespot.campaigns.ending import Ending
from conespot.campaigns.subcommands import say_results

TYPE_CHECKING = False  # `typing` takes long to import
if TYPE_CHECKING:
    import argparse


def export(options: argparse.Namespace) -> Ending:
    """Write the frames of a run for other people's methods."""
    from conespot.campaigns.export import export

    for line in export(options.folder, options.frames, options.workers):
        streams.say(line)
    return Ending.DONE


def score(options: argparse.Namespace) -> Ending:
    """Join what another method found."""
    from conespot.campaigns.scoring import score

    sentence = score(options.folder, options.estimates, options.name)
    say_results(options.folder)
    streams.say(sentence)
    return Ending.DONE
