"""What `campaign track` does with its options. Everything heavy is imported where it is used."""

from __future__ import annotations

from conespot.campaigns import streams
from conespot.campaigns.ending import Ending

TYPE_CHECKING = False  # `typing` takes long to import
if TYPE_CHECKING:
    import argparse


def track(options: argparse.Namespace) -> Ending:
    """Follow the needle through frames of one's own camera."""
    from conespot.campaigns.own_frames import Count, localize, make_alarm, make_rate, outputs
    from conespot.campaigns.own_track import OwnTrack
    from conespot.scene.document import InputError

    if options.smooth and (options.overlay or options.mcap):
        raise InputError("--smooth: keeps no frames; leave out --overlay and --mcap, or --smooth")
    rate = make_rate(options.rate)
    own = OwnTrack(options.scene, options.set, options.localizer, rate, live=options.live, smooth=options.smooth)
    count = Count()
    alarm = make_alarm(options.alarm, options.false_safe, own.scene)
    beside = outputs(own, alarm, options)
    if options.reference:
        own.learn(options.reference)
    for line in localize(own, options.frames, alarm, beside, count):
        streams.say(line)
    streams.say(own.sentence())
    if count.sentence:
        streams.complain(f"campaign: {count.sentence}")
    return Ending.FAILED if count.sentence else Ending.DONE
