"""The command `campaign`. Everything heavy is imported where it is used, so that --help is instant."""

from __future__ import annotations

import os
import sys

from conespot.campaigns import streams
from conespot.campaigns.ending import Ending, RunError
from conespot.campaigns.interruption import interruption

TYPE_CHECKING = False  # `typing` takes long to import, and until `main` begins Ctrl-C gives a traceback
if TYPE_CHECKING:
    import argparse
    from collections.abc import Sequence


def main(arguments: Sequence[str] | None = None) -> int:
    """Run a command line; the exit code: 0 done, 1 something failed, 2 bad input, 130 interrupted.

    Without `arguments` it is the process's own, and its signals are `campaigns.interruption`'s; else the caller's.
    """
    if arguments is None:
        interruption.listen()
        streams.make_safe()
        os.environ["MPLBACKEND"] = "agg"  # figures are files, whatever a notebook or a desktop has left there
    options = _options(arguments)
    from conespot.scene.document import InputError

    try:
        code: Ending = options.run(options)
        return code
    except InputError as error:
        from conespot.campaigns.mistaken import mistaken

        return _complain(InputError(mistaken(options) or str(error)), Ending.BAD_INPUT)
    except KeyboardInterrupt:
        return _complain("interrupted", Ending.INTERRUPTED)
    except streams.UnheardError as error:
        # silently where the reader went away, as in `campaign plan | head`
        return _complain(error, Ending.FAILED) if str(error) else Ending.FAILED
    except RunError as error:
        return _complain(error, Ending.FAILED)
    except Exception as error:
        # a defect: the user gets a sentence, and the traceback by asking for it
        if os.environ.get("CONESPOT_TRACEBACK"):
            raise
        return _complain(f"{type(error).__name__}: {error} (CONESPOT_TRACEBACK=1 shows where)", Ending.FAILED)


def _options(arguments: Sequence[str] | None) -> argparse.Namespace:
    from conespot.campaigns.command_line import parser

    line = parser()
    options, more = line.parse_known_args(arguments)
    frames = getattr(options, "frames", None)
    if isinstance(frames, list) and not any(text.startswith("-") for text in more):
        from pathlib import Path

        frames += map(Path, more)  # those that stand behind an option, which argparse leaves over
    elif more:
        line.error(f"unrecognized arguments: {' '.join(more)}")
    return options


def _complain(error: object, code: Ending) -> Ending:
    streams.complain(f"campaign: {error}")
    return code


if __name__ == "__main__":
    sys.exit(main())
