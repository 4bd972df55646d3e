"""The networks of section 6.3.3, from three outputs of a press to diameter, depth and modulus."""

from typing import TYPE_CHECKING

import lazy_loader

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

if TYPE_CHECKING:
    from tsis.inclusion.network._adapter import NetworkRegressor

__all__ = [
    "Layers",
    "LinearMapping",
    "Network",
    "NetworkRegressor",
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

if not TYPE_CHECKING:  # its base class is of scikit-learn
    __getattr__ = lazy_loader.attach(__name__, submod_attrs={"_adapter": ["NetworkRegressor"]})[0]
