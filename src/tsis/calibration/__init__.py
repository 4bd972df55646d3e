"""What makes a probe's grey levels mean something: scale, light, force, and whether a press is usable."""

from tsis.calibration.measured import Measured

__all__ = ["Measured"]
