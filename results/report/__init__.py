"""The report: one HTML file that opens anywhere, needs nothing beside it, and trusts nothing that stands in the run."""

from conespot.results.report.page import make_report

__all__ = ["make_report"]
