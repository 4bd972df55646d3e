"""What ships with the package: probes, phantoms and spheres, as TOML files that a user can copy and replace."""

from tsis.catalog._entries import (
    list_phantoms,
    list_probes,
    list_spheres,
    load_phantom,
    load_probe,
    load_sphere,
    parse_probe,
    phantom_variant,
    probe_toml,
    probe_variant,
)

__all__ = [
    "list_phantoms",
    "list_probes",
    "list_spheres",
    "load_phantom",
    "load_probe",
    "load_sphere",
    "parse_probe",
    "phantom_variant",
    "probe_toml",
    "probe_variant",
]
