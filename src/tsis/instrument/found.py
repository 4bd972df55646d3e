"""What a search for cameras says about each one that it found."""

from __future__ import annotations

from dataclasses import dataclass

from tsis.model.check import require_type


@dataclass(frozen=True, slots=True, kw_only=True)
class CameraInfo:
    """A camera that answered a search, with what is needed to connect to it.

    Parameters
    ----------
    source
        Name of the source that can reach it, e.g. ``"aravis"``.
    identity
        What that source calls it: a serial number, an address or an index, unique among the source's cameras.
    maker, model
        Who made it and what it is; empty where the source does not tell.
    note
        What else helps to tell it from another, e.g. its address.

    Examples
    --------
    >>> CameraInfo(source="pylon", identity="0815-0000", maker="Basler", model="Emulation").spec
    'pylon:0815-0000'
    """

    source: str
    identity: str
    maker: str = ""
    model: str = ""
    note: str = ""

    def __post_init__(self) -> None:
        for name in ("source", "identity", "maker", "model", "note"):
            require_type(name, getattr(self, name), str)

    @property
    def spec(self) -> str:
        """What `tsis.instrument.discovery.connect` takes to reach it."""
        return f"{self.source}:{self.identity}"
