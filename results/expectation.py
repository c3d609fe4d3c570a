"""What a campaign expects of its own tables: published numbers with how near ours must come, and plain bounds."""

from __future__ import annotations

import math
import re
from typing import Annotated, Any, Literal

from pydantic import BeforeValidator, Field, FiniteFloat, model_validator

from conespot.results.metrics import METRICS
from conespot.scene.model import Model, unknown_name

_PERCENT = re.compile(r"\s*(\d+\.?\d*|\.\d+)\s*%\s*", re.ASCII)
#: in place of labels: every line, whatever the column holds
ANY = "any"
#: the ways to say how near is near enough
BOUNDS = ("within", "at_most", "at_least")


def _known_metric(value: Any) -> Any:
    if isinstance(value, str) and value not in METRICS:
        raise unknown_name(value, list(METRICS), "metric")
    return value


def _amount(value: Any) -> Any:
    if isinstance(value, bool) or not isinstance(value, (int, float, str)):
        raise ValueError(f"must be a number in the metric's unit or a share of `value` such as '10 %', got {value!r}")
    if isinstance(value, str) and not _PERCENT.fullmatch(value):
        raise ValueError(f"write a number in the metric's unit or a share of `value` such as '10 %', got {value!r}")
    return value


def _word(value: Any) -> Any:
    if isinstance(value, str) and not value.isprintable():
        raise ValueError(f"must be printable characters, got {value[:40]!r}")
    return value


def _labels(value: Any) -> Any:
    """One label or a list of them, each a word or a finite number."""
    if isinstance(value, (list, tuple)) and value:
        return tuple(_labels(item) if not isinstance(item, (list, tuple)) else _labels(None) for item in value)
    numeric = isinstance(value, (int, float)) and not isinstance(value, bool) and math.isfinite(value)
    if not numeric and not isinstance(value, str):
        raise ValueError(f"must be a label, a number or a list of these, got {value!r}")
    return _word(value) if isinstance(value, str) else float(value)


#: a number in the metric's unit, or a share of the expected value, "10 %"
Amount = Annotated[FiniteFloat | Annotated[str, Field(max_length=20)], BeforeValidator(_amount)]
_Text = Annotated[str, BeforeValidator(_word), Field(max_length=200)]
#: the value of a column in the lines that are meant
Label = str | float
_Labels = Annotated[Label | tuple[Label, ...], BeforeValidator(_labels)]


class Expectation(Model):
    """A number that must come out: `metric` over the lines `where` columns hold these labels.

    A list of labels takes their lines together, `any` those of all. `value` is what is published; one of `within`,
    `at_most` and `at_least` says what is near enough, as a number in the metric's unit or a share of `value`, "10 %".
    """

    metric: Annotated[str, BeforeValidator(_known_metric)]
    where: dict[_Text, _Labels] = Field({}, max_length=50)
    value: FiniteFloat | None = None
    within: Amount | None = None
    at_most: Amount | None = None
    at_least: Amount | None = None
    source: _Text = ""

    @model_validator(mode="after")
    def _one_bound(self) -> Expectation:
        given = [name for name in BOUNDS if getattr(self, name) is not None]
        if len(given) != 1:
            raise ValueError(f"needs one of {', '.join(BOUNDS)}, got {' and '.join(given) or 'none'}")
        if self.value is None and (self.within is not None or isinstance(self._bound[1], str)):
            raise ValueError(f"{given[0]} needs the `value` that it is about")
        return self

    @property
    def _bound(self) -> tuple[Literal["within", "at_most", "at_least"], float | str]:
        if self.within is not None:
            return "within", self.within
        if self.at_most is not None:
            return "at_most", self.at_most
        assert self.at_least is not None, "one is given"
        return "at_least", self.at_least

    @property
    def target(self) -> float:
        """What a found number is divided by to say how far off it is: the value, or the bound where there is none."""
        return self.value if self.value is not None else self._amount

    @property
    def _amount(self) -> float:
        """The bound in the metric's unit."""
        amount = self._bound[1]
        if isinstance(amount, float):
            return amount
        match = _PERCENT.fullmatch(amount)
        assert match is not None, "validated"
        assert self.value is not None, "validated"
        return float(match[1]) / 100.0 * abs(self.value)

    def met_by(self, found: float) -> bool:
        """Whether a number is near enough; NaN never is."""
        match self._bound[0]:
            case "within":
                return abs(found - self.target) <= self._amount
            case "at_most":
                return found <= self._amount
            case "at_least":
                return found >= self._amount

    @property
    def words(self) -> str:
        """What is expected, such as "0.026 ± 10 %"."""
        kind, amount = self._bound
        said = amount if isinstance(amount, str) else f"{amount:g}"
        if kind == "within":
            return f"{self.value:g} ± {said}"
        of = f" of {self.value:g}" if isinstance(amount, str) else ""
        return f"{kind.replace('_', ' ')} {said}{of}"


Expectations = Annotated[tuple[Expectation, ...], Field(max_length=1000)]
