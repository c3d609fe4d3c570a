"""What a number assumes, as the run's own description of its cases says it: nothing is guessed back from names."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import asdict, dataclass

import pandas as pd

from conespot.results.cases import Case
from conespot.scene.power import BothConventions

NOT_STATED, NOT_USED = "not stated", "not used"
_MOST = 4
_OR = " or "

Cases = Mapping[str, Case]
#: what some rows are about: keys of cases, each with a localizer
Pairs = Sequence[tuple[str, str]]


@dataclass(frozen=True)
class Assumptions:
    """The assumption set that stands beside every number."""

    radius: str = NOT_STATED
    edge: str = NOT_STATED
    power_convention: str = NOT_STATED
    transfer: str = NOT_STATED
    surface_shape: str = NOT_STATED
    threshold: str = NOT_STATED
    ambiguity: str = NOT_STATED

    def columns(self) -> dict[str, str]:
        """The set as columns of a table."""
        return asdict(self)

    def sentence(self, beside: Iterable[str] = ()) -> str:
        """The set in one line, without the columns `beside` that are told elsewhere."""
        told = {key: value for key, value in asdict(self).items() if key not in set(beside)}
        return "; ".join(f"{key.replace('_', ' ')}: {value}" for key, value in told.items())


def pairs(rows: pd.DataFrame) -> Pairs:
    """The cases of some rows, each with the localizers of its rows."""
    return list(dict.fromkeys(zip(rows["case"], rows["localizer"], strict=True)))


def assumptions(cases: Cases, about: Pairs) -> Assumptions:
    """The assumption set of rows about these pairs, in a run with these cases.

    Where the pairs differ, what each of them assumes is named. A case that is not described states nothing.
    """
    return together(_of(cases.get(case), localizer) for case, localizer in about)


def together(sets: Iterable[Assumptions]) -> Assumptions:
    """What several sets assume, named where they differ."""
    columns = [one.columns() for one in dict.fromkeys(sets)]
    return Assumptions(**{name: either(one[name] for one in columns) for name in Assumptions().columns()})


def common(sets: Iterable[Assumptions]) -> dict[str, str]:
    """The columns in which several sets are equal, with what they say; none of no set."""
    columns = [one.columns() for one in dict.fromkeys(sets)]
    return (
        {name: value for name, value in columns[0].items() if all(one[name] == value for one in columns)}
        if columns
        else {}
    )


def theory_assumptions() -> Assumptions:
    """The assumption set of Table I: by definition the paper's sphere (z0 = -7 mm), with no light and no image."""
    return Assumptions("12 mm", NOT_USED, NOT_USED, NOT_USED, "smooth", NOT_USED, NOT_USED)


def _of(case: Case | None, localizer: str) -> Assumptions:
    if case is None:
        return Assumptions()
    scene, words = case.assumes, case.localizers.get(localizer)
    return Assumptions(
        radius=scene.radius,
        edge=scene.edge,
        power_convention=scene.power_convention,
        transfer=scene.transfer,
        surface_shape=scene.surface,
        threshold=words.threshold if words else NOT_STATED,
        ambiguity=words.ambiguity if words else NOT_STATED,
    )


def watts_of(cases: Cases, about: Pairs) -> BothConventions | None:
    """The power of these pairs' cases in both conventions; None if they do not state it, or not the same."""
    stated = {cases[key].watts if key in cases else None for key, _ in about}
    return stated.pop() if len(stated) == 1 else None


def power_in_words(cases: Cases, about: Pairs, power_w: float) -> str:
    """What `power_w`, the power of these pairs' cases as they state it, is in both conventions."""
    unknown = f"{power_w:g} W (convention not stated)"
    return either(cases[key].watts.words if key in cases else unknown for key, _ in about)


def either(words: Iterable[str]) -> str:
    """The distinct words in the order in which they come, such as "smooth or 15 bumps"."""
    distinct = list(dict.fromkeys(one for said in words for one in said.split(_OR)))
    more = [f"{len(distinct) - _MOST} others"] if len(distinct) > _MOST else []
    return _OR.join([*distinct[:_MOST], *more]) or NOT_STATED
