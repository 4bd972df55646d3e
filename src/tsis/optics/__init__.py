"""Light in the probe: angles and guided modes of its layers, waves in a dented guide, rays in the whole probe."""

from tsis.optics.end_face import Acceptance, acceptance
from tsis.optics.irradiance_field import Irradiance
from tsis.optics.irradiance_trace import irradiance
from tsis.optics.propagation import Dent, Propagation, ThinGuide, propagate, thin_guide
from tsis.optics.rays_path import trace_paths
from tsis.optics.rays_trace import Tally, TracedLight, trace_rays
from tsis.optics.slab import GuidedModes, guided_modes
from tsis.optics.snell import Fresnel, critical_angle_deg, fresnel, refraction_deg

__all__ = [
    "Acceptance",
    "Dent",
    "Fresnel",
    "GuidedModes",
    "Irradiance",
    "Propagation",
    "Tally",
    "ThinGuide",
    "TracedLight",
    "acceptance",
    "critical_angle_deg",
    "fresnel",
    "guided_modes",
    "irradiance",
    "propagate",
    "refraction_deg",
    "thin_guide",
    "trace_paths",
    "trace_rays",
]
