"""Probes, phantoms, spheres, gel sensors and priors of the package, as TOML files that a user can copy and replace."""

from tsis.catalog.phantoms import list_phantoms, list_spheres, load_phantom, load_sphere, phantom_variant
from tsis.catalog.priors import (
    default_prior_toml,
    inclusion_prior_toml,
    list_inclusion_priors,
    parse_prior,
    read_prior_file,
)
from tsis.catalog.probes import list_probes, load_probe, parse_probe, probe_toml, probe_variant
from tsis.catalog.sensors import list_sensors, load_sensor, parse_sensor, sensor_toml

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
