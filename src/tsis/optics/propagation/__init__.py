"""Waves in a pressed thin guide: beam propagation for sweeps, a frequency-domain solution as reference."""

from tsis.optics.propagation._guide import Dent, ThinGuide, interfaces_um, thin_guide
from tsis.optics.propagation._power import Powers
from tsis.optics.propagation._propagate import Propagation, propagate

__all__ = ["Dent", "Powers", "Propagation", "ThinGuide", "interfaces_um", "propagate", "thin_guide"]
