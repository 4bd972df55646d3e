"""A camera's frames as they come: kept in a ring, counted, and watched, so that nothing is lost in silence."""

from tsis.instrument.acquisition.account import Account, Interruption
from tsis.instrument.acquisition.acquisition import Acquisition
from tsis.instrument.acquisition.arrival import ReceivedFrame
from tsis.instrument.acquisition.frame_rate import FrameRate
from tsis.instrument.acquisition.intake import Intake
from tsis.instrument.acquisition.ring import FrameRing

__all__ = ["Account", "Acquisition", "FrameRate", "FrameRing", "Intake", "Interruption", "ReceivedFrame"]
