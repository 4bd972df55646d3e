"""Probes, phantoms, spheres, gel sensors and priors of the package, as TOML files that a user can copy and replace."""

from tsis.catalog._entries import (
    list_phantoms,
    list_probes,
    list_sensors,
    list_spheres,
    load_phantom,
    load_probe,
    load_sensor,
    load_sphere,
    parse_probe,
    parse_sensor,
    phantom_variant,
    probe_toml,
    probe_variant,
    sensor_toml,
)
from tsis.catalog._priors import (
    default_prior_toml,
    inclusion_prior_toml,
    list_inclusion_priors,
    parse_prior,
    read_prior_file,
)

__all__ = [
    "default_prior_toml",
    "inclusion_prior_toml",
    "list_inclusion_priors",
    "list_phantoms",
    "list_probes",
    "list_sensors",
    "list_spheres",
    "load_phantom",
    "load_probe",
    "load_sensor",
    "load_sphere",
    "parse_prior",
    "parse_probe",
    "parse_sensor",
    "phantom_variant",
    "probe_toml",
    "probe_variant",
    "read_prior_file",
    "sensor_toml",
]
