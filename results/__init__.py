"""Results: rows to box statistics, tables, figures and a report. Reads files only, so anybody's run will do."""

from conespot.results.writing import tables_text, write_results

__all__ = ["tables_text", "write_results"]
