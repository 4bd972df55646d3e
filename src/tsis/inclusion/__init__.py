"""Size, depth and stiffness of an inclusion under the surface."""

from tsis.inclusion.design_alternatives import Design, alternatives, compare, ranked
from tsis.inclusion.design_information import Information, even_inclusions, information, source_inclusions
from tsis.inclusion.design_limits import Limits
from tsis.inclusion.design_protocol import PlannedPress, Protocol, default_protocols, protocol_of
from tsis.inclusion.design_search import Optimum, optimise
from tsis.inclusion.frames import ring_edges
from tsis.inclusion.mobility_track import Mobility, mobility
from tsis.inclusion.network import Layers, Network
from tsis.inclusion.network_frames import frame_outputs, printed_frame_outputs
from tsis.inclusion.network_mapping import LinearMapping, fit_mapping, mapped_without_itself
from tsis.inclusion.network_outputs import Reading, change_reading, printed_reading, simulated_outputs
from tsis.inclusion.network_training import Training, train_network
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
    "InclusionPrior",
    "Information",
    "Layers",
    "Limits",
    "LinearMapping",
    "Mobility",
    "Network",
    "ObjectShape",
    "Optimum",
    "PlannedPress",
    "Protocol",
    "Reading",
    "RelativeReading",
    "Repeats",
    "Training",
    "TwoMeans",
    "alternatives",
    "binary_image",
    "change_reading",
    "compare",
    "default_protocols",
    "estimate",
    "estimate_by_networks",
    "even_inclusions",
    "fit_mapping",
    "frame_outputs",
    "information",
    "mapped_without_itself",
    "mobility",
    "object_shape",
    "optimise",
    "printed_frame_outputs",
    "printed_reading",
    "protocol_of",
    "ranked",
    "ratios",
    "relative_depth",
    "relative_hardness",
    "relative_size",
    "ring_edges",
    "simulated_outputs",
    "source_inclusions",
    "train_network",
    "two_means",
]
