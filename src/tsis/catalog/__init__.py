"""Probes, phantoms, spheres, gel sensors and priors of the package, as TOML files that a user can copy and replace."""

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
from tsis.catalog._priors import (
    default_prior_toml,
    inclusion_prior_toml,
    list_inclusion_priors,
    parse_prior,
    read_prior_file,
)
from tsis.catalog._sensors import list_sensors, load_sensor, parse_sensor, sensor_toml

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
