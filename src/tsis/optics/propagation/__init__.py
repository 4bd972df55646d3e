"""Waves in a thin guide that is pressed: beam propagation for sweeps, the frequency domain as the referee."""

from tsis.optics.propagation._guide import Dent, ThinGuide, interfaces_um, thin_guide
from tsis.optics.propagation._power import Powers
from tsis.optics.propagation._propagate import Propagation, propagate

__all__ = ["Dent", "Powers", "Propagation", "ThinGuide", "interfaces_um", "propagate", "thin_guide"]
