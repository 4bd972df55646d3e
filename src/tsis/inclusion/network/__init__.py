"""The networks of section 6.3.3, from three outputs of a press to diameter, depth and modulus."""

from tsis.inclusion.network._network import Layers, Network
from tsis.inclusion.network._outputs import (
    OutputReading,
    change_reading,
    frame_outputs,
    pressure_outputs,
    printed_frame_outputs,
    printed_reading,
    simulated_outputs,
)
from tsis.inclusion.network._trained import TrainedNetworks, read_networks, train_networks, write_networks
from tsis.inclusion.network._training import NetworkTraining, train_network
from tsis.inclusion.network._trials import LinearMapping, estimate_by_networks, fit_mapping, leave_one_out_mapping

__all__ = [
    "Layers",
    "LinearMapping",
    "Network",
    "NetworkTraining",
    "OutputReading",
    "TrainedNetworks",
    "change_reading",
    "estimate_by_networks",
    "fit_mapping",
    "frame_outputs",
    "leave_one_out_mapping",
    "pressure_outputs",
    "printed_frame_outputs",
    "printed_reading",
    "read_networks",
    "simulated_outputs",
    "train_network",
    "train_networks",
    "write_networks",
]
