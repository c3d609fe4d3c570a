"""What variants are called, and which columns of a table are numbers."""

import pandas as pd

from conespot.results.table import Block, number
from conespot.results.variants import named, split


def test_what_a_campaign_s_own_choices_say_is_not_said_again():
    rows = [
        {"localizer": "paper", "illumination": light, "sensor": sensor, "light": name, "effect": effect}
        for name, light in (("green", "line532"), ("infrared", "ir850"))
        for effect, sensor in (("ideal", "a"), ("recording", "a, JPEG 90"))
    ]
    frame = pd.DataFrame(rows)
    assert sorted(variant.label for variant, _ in split(frame, list(frame))) == [
        "paper, light green, effect ideal", "paper, light green, effect recording",
        "paper, light infrared, effect ideal", "paper, light infrared, effect recording",
    ]  # fmt: skip
    free = frame.assign(effect=["ideal", "ideal", "ideal", "recording"])
    assert "paper, a, JPEG 90, light green, effect ideal" in [v.label for v, _ in split(free, list(free))]


def test_words_that_begin_with_a_number_are_words():
    block = Block("", ("radius", "error", "refused"), (("12 mm", "0.031*", "0 of 2"), ("", "–", "1 of 2")), ())
    assert block.flush_right == (True, True, True)
    seen = Block("", ("radius",), (("12 mm",), ("12 mm seen through navarro eye",)), ())
    assert seen.flush_right == (False,)


def test_numbers_are_written_as_people_read_them():
    assert [number(value) for value in (0.0312, 3991.0, 1234567.0, float("nan"))] == ["0.0312", "3990", "1.23e+06", "–"]
    assert (named("power_w", 8e-5), named("power_w", 0.25)) == ("0.08 mW", "0.25 W")
