"""campaigns.progress: honest about the time that remains, and quiet where nobody watches."""

import io

from conespot.campaigns.progress import Progress


class Clock:
    now = 0.0

    def __call__(self):
        return self.now


class Terminal(io.StringIO):
    def isatty(self):
        return True


def run(stream, units=100, seconds=1.0, frames=2):
    clock = Clock()
    progress = Progress(units * frames, float(units), stream, clock)
    for _ in range(units):
        clock.now += seconds
        progress.update(frames, 1.0, 0)
    progress.close()
    return progress


def test_the_remaining_time_is_that_of_the_pace():
    clock = Clock()
    progress = Progress(100, 100.0, io.StringIO(), clock)
    clock.now = 30.0  # loading, which says nothing about the pace
    for _ in range(10):
        clock.now += 2.0
        progress.update(1, 1.0, 0)
    assert progress.remaining() == 2.0 * 90


def test_a_change_of_pace_is_followed():
    clock = Clock()
    progress = Progress(300, 300.0, io.StringIO(), clock)
    for seconds in [1.0] * 100 + [5.0] * 100:
        clock.now += seconds
        progress.update(1, 1.0, 0)
    assert progress.remaining() == 5.0 * 100


def test_nothing_is_promised_before_the_pace_is_known():
    clock = Clock()
    progress = Progress(100, 100.0, io.StringIO(), clock)
    for _ in range(4):
        clock.now += 1.0
        progress.update(1, 1.0, 0)
        assert progress.remaining() is None
        assert "left" not in progress.line()


def test_a_log_gets_few_whole_lines():
    stream = io.StringIO()
    run(stream, units=1000)
    lines = stream.getvalue().splitlines()
    assert 5 < len(lines) < 25
    assert "\r" not in stream.getvalue()
    assert lines[-1] == "2000 of 2000 frames (100%), 16:40"


def test_a_terminal_has_one_line_rewritten():
    stream = Terminal()
    run(stream, units=50)
    assert stream.getvalue().count("\n") == 1
    assert stream.getvalue().count("\r") > 50


def test_a_note_is_not_lost_in_the_rewritten_line():
    stream = Terminal()
    progress = Progress(10, 10.0, stream, Clock())
    progress.update(1, 1.0, 0)
    progress.note("a worker was killed")
    assert stream.getvalue().endswith("\ra worker was killed\n")


def test_failed_localizations_are_counted():
    progress = Progress(10, 10.0, io.StringIO(), Clock())
    progress.update(2, 1.0, 3)
    assert progress.line() == "2 of 10 frames (20%), 3 not localized, 0:00"


class Wide(io.TextIOWrapper):
    """A terminal of an encoding."""

    def __init__(self, encoding):
        super().__init__(io.BytesIO(), encoding=encoding)

    def isatty(self):
        return True


def test_the_bar_fills_from_empty_to_full_in_what_the_terminal_can_show():
    for encoding, full, half in (("utf-8", "\u2588" * 24 + "|", "\u2588" * 12), ("ascii", f"[{'#' * 24}]", "#" * 12)):
        stream = Wide(encoding)
        run(stream, units=10)
        stream.flush()
        lines = stream.buffer.getvalue().decode(encoding).split("\r")
        assert lines[5].startswith(("[", "\u2588"))
        assert half in lines[5]
        assert full not in lines[5]
        assert full in lines[10]
        assert "2 frames/s" in lines[10]
