"""The cropper: a worker's bench that also looks again at frames and keeps small pictures of them."""

from __future__ import annotations

from dataclasses import dataclass

from conespot.campaigns.bench import Bench, finding
from conespot.campaigns.plan import Plan, Unit
from conespot.campaigns.row import Record
from conespot.results.crops import Crop, crop_of


@dataclass(frozen=True)
class ToCrop(Unit):
    """A unit that is not to be measured: of its frames, those of these cases' keys, what these localizers see."""

    seen: tuple[tuple[str, tuple[str, ...]], ...]


class Cropped(Record):
    """What localizers found in frames of a unit, and a picture of each."""

    crops: tuple[Crop, ...]


class Cropper:
    """Measures the units of a plan as its bench does, and makes crops of those that ask for them."""

    def __init__(self, plan: Plan, bench: Bench) -> None:
        self._plan, self._bench = plan, bench
        self.variant = bench.variant

    @property
    def worn(self) -> bool:
        """True when the process should make room for a fresh one."""
        return self._bench.worn

    def measure(self, unit: Unit) -> Record:
        """The unit's record, with crops if those are what it asks for."""
        return self._cropped(unit) if isinstance(unit, ToCrop) else self._bench.measure(unit)

    def _cropped(self, unit: ToCrop) -> Cropped:
        from conespot.campaigns.easel import overlay_of  # with the renderer, which who asks for crops does without

        seen, crops, findings = dict(unit.seen), [], []
        for case, image, unlit in self._bench.given(unit, seen):
            for name in seen[case.key]:
                outcome = self._bench.located(unit, case, image, name, unlit)
                overlay = overlay_of(self._plan, unit, case, image, name, outcome, residuals=False)
                crops.append(crop_of(case.key, name, unit.pose, overlay))
                findings.append(finding(case, name, outcome, None))
        return Cropped(unit=unit.key, findings=tuple(findings), crops=tuple(crops))
