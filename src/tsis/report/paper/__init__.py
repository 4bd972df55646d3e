"""A report as a PDF file."""

from tsis.errors import require_extra

require_extra("reportlab", feature="a report as PDF", extra="report")

from tsis.report.paper._pdf import pdf

__all__ = ["pdf"]
