"""Size, depth and stiffness of an inclusion under the surface."""

from tsis.inclusion.design_alternatives import Design, compare_designs, design_alternatives, rank_designs
from tsis.inclusion.design_information import (
    ProtocolInformation,
    dissertation_inclusions,
    even_inclusions,
    protocol_information,
)
from tsis.inclusion.design_limits import DesignLimits
from tsis.inclusion.design_protocol import PlannedPress, Protocol, default_protocols, protocol_of
from tsis.inclusion.design_search import DesignOptimum, optimise_design
from tsis.inclusion.frames import ring_edges
from tsis.inclusion.mobility_track import Mobility, mobility
from tsis.inclusion.network import Layers, Network
from tsis.inclusion.network_frames import frame_outputs, printed_frame_outputs
from tsis.inclusion.network_mapping import LinearMapping, fit_mapping, leave_one_out_mapping
from tsis.inclusion.network_outputs import OutputReading, change_reading, printed_reading, simulated_outputs
from tsis.inclusion.network_training import NetworkTraining, train_network
from tsis.inclusion.network_trials import estimate_by_networks
from tsis.inclusion.posterior import estimate
from tsis.inclusion.prior import PARAMETERS, InclusionPrior
from tsis.inclusion.relative_brightness import relative_depth
from tsis.inclusion.relative_diameter import relative_size
from tsis.inclusion.relative_reading import RelativeReading
from tsis.inclusion.relative_repeats import Repeats, ratios
from tsis.inclusion.relative_stiffness import relative_hardness
from tsis.inclusion.shape_binary import binary_image
from tsis.inclusion.shape_outline import ObjectShape, object_shape
from tsis.inclusion.shape_threshold import TwoMeans, two_means

__all__ = [
    "PARAMETERS",
    "Design",
    "DesignLimits",
    "DesignOptimum",
    "InclusionPrior",
    "Layers",
    "LinearMapping",
    "Mobility",
    "Network",
    "NetworkTraining",
    "ObjectShape",
    "OutputReading",
    "PlannedPress",
    "Protocol",
    "ProtocolInformation",
    "RelativeReading",
    "Repeats",
    "TwoMeans",
    "binary_image",
    "change_reading",
    "compare_designs",
    "default_protocols",
    "design_alternatives",
    "dissertation_inclusions",
    "estimate",
    "estimate_by_networks",
    "even_inclusions",
    "fit_mapping",
    "frame_outputs",
    "leave_one_out_mapping",
    "mobility",
    "object_shape",
    "optimise_design",
    "printed_frame_outputs",
    "printed_reading",
    "protocol_information",
    "protocol_of",
    "rank_designs",
    "ratios",
    "relative_depth",
    "relative_hardness",
    "relative_size",
    "ring_edges",
    "simulated_outputs",
    "train_network",
    "two_means",
]
