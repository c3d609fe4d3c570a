"""Time stamps in whole nanoseconds, as ROS 2 and MCAP keep them: what is recorded and read again is the same number."""

from __future__ import annotations

from fractions import Fraction

NANO = 10**9


def nanoseconds(time_s: float) -> int:
    """A time [s] in whole nanoseconds, rounded without the errors of a product."""
    return round(Fraction(time_s) * NANO)


def seconds(stamp_ns: int) -> float:
    """The time [s] nearest to whole nanoseconds; `seconds(nanoseconds(...))` of it is itself.

    >>> seconds(nanoseconds(2 / 120)), seconds(nanoseconds(seconds(1_700_000_000_123_456_789)))
    (0.016666667, 1700000000.1234567)
    """
    return stamp_ns / NANO
