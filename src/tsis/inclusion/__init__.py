"""Size, depth and stiffness of an inclusion under the surface."""

from tsis.inclusion.frames import ring_edges
from tsis.inclusion.network import Layers, Network
from tsis.inclusion.network_frames import frame_outputs, printed_frame_outputs
from tsis.inclusion.network_mapping import LinearMapping, fit_mapping, mapped_without_itself
from tsis.inclusion.network_outputs import Reading, change_reading, printed_reading, simulated_outputs
from tsis.inclusion.network_training import Training, train_network
from tsis.inclusion.network_trials import estimate_by_networks
from tsis.inclusion.posterior import estimate
from tsis.inclusion.prior import PARAMETERS, InclusionPrior

__all__ = [
    "PARAMETERS",
    "InclusionPrior",
    "Layers",
    "LinearMapping",
    "Network",
    "Reading",
    "Training",
    "change_reading",
    "estimate",
    "estimate_by_networks",
    "fit_mapping",
    "frame_outputs",
    "mapped_without_itself",
    "printed_frame_outputs",
    "printed_reading",
    "ring_edges",
    "simulated_outputs",
    "train_network",
]
