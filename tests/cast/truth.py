"""What executors without workers answer: the truth."""

from conespot.campaigns.plan import Plan, Unit
from conespot.campaigns.row import Finding, Record


def true_record(plan: Plan, unit: Unit, *, off: float = 0.0, by: str = "") -> Record:
    """The true pose of a unit from every localizer of every case, its tip `off` [mm] in each coordinate."""
    group = plan.groups[unit.group]
    pose = group.pose(unit.pose)
    true = {"apex": tuple((pose.apex + off).tolist()), "axis": tuple(pose.axis.tolist())}
    findings = (Finding(case=case.key, localizer=name, **true) for case in group.cases for name in case.localizers)
    return Record(unit=unit.key, by=by, findings=tuple(findings))
