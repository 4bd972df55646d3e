"""Results that people read and programs reload: one page as HTML or PDF, one JSON file, the frames beside them."""

from tsis.report.contact import contact_report
from tsis.report.folder import free_folder, write_folder
from tsis.report.inclusion import inclusion_report
from tsis.report.target import target_page

__all__ = ["contact_report", "free_folder", "inclusion_report", "target_page", "write_folder"]
