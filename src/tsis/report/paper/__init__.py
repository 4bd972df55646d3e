"""A report as a PDF file."""

from tsis.report.paper._pdf import pdf

__all__ = ["pdf"]
