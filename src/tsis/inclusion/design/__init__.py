"""Expected accuracy of a planned probe and protocol, its limits, and the search for better ones."""

from tsis.inclusion.design._alternatives import (
    ASPECTS,
    CRITERIA,
    Design,
    compare_designs,
    design_alternatives,
    rank_designs,
)
from tsis.inclusion.design._information import (
    ProtocolInformation,
    dissertation_inclusions,
    even_inclusions,
    protocol_information,
)
from tsis.inclusion.design._limits import DesignLimits
from tsis.inclusion.design._protocol import (
    MOST_FRAMES_PER_PRESS,
    PlannedPress,
    Protocol,
    default_protocols,
    protocol_of,
)
from tsis.inclusion.design._search import MOST_EVALUATIONS, DesignOptimum, optimise_design

__all__ = [
    "ASPECTS",
    "CRITERIA",
    "MOST_EVALUATIONS",
    "MOST_FRAMES_PER_PRESS",
    "Design",
    "DesignLimits",
    "DesignOptimum",
    "PlannedPress",
    "Protocol",
    "ProtocolInformation",
    "compare_designs",
    "default_protocols",
    "design_alternatives",
    "dissertation_inclusions",
    "even_inclusions",
    "optimise_design",
    "protocol_information",
    "protocol_of",
    "rank_designs",
]
