"""Topology-preserving relaxation labelling."""

from tsis.matching.tps_rpm import fit

__all__ = ["fit"]
