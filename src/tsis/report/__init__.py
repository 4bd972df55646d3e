"""Results that people read and programs reload: one HTML page, one JSON file, the frames beside them."""

from tsis.report.contact import contact_report
from tsis.report.folder import free_folder, write_folder
from tsis.report.inclusion import inclusion_report

__all__ = ["contact_report", "free_folder", "inclusion_report", "write_folder"]
