"""Findings of an estimate from contacts: what cannot follow from them, and what speaks against them."""

from __future__ import annotations

from typing import TYPE_CHECKING

import scipy

from tsis.model import IMPROBABLE, probability_bound

if TYPE_CHECKING:
    from collections.abc import Sequence

    from tsis.hardness._contact_readings import TouchReading
    from tsis.hardness._object_geometry import ObjectGeometry
    from tsis.model import GelSensor

    Finding = tuple[str, str]

WIDEST_CONTACT = 0.6  # of half the face's smaller side
DEEPEST_CONTACT = 0.9  # of the object's radius: the model was compared with finite strain up to there
SAME_FORCE = 0.02


def unknowable(readings: Sequence[TouchReading], shape: ObjectGeometry) -> list[Finding]:
    """Why no modulus can follow from such contacts, at most one reason."""
    if shape.shape == "flat":
        note = "The modulus is not identifiable: the contact of a flat object does not change with its modulus."
        return [("young_kpa_not_identified", note)]
    forces = [reading for reading in readings if reading.force_n is not None]
    pairs = [reading for reading in readings if reading.radius_mm is not None and reading.depth_mm is not None]
    if not forces and shape.radius_mm is None:
        note = "The modulus is not identifiable: force and radius of the object are both unknown (give one of them)."
        return [("young_kpa_not_identified", note)]
    if not forces and not pairs:
        note = "The modulus is not identifiable: without a force each contact needs radius_mm and depth_mm."
        return [("young_kpa_not_identified", note)]
    return []


def contact_findings(
    readings: Sequence[TouchReading], left_out: Sequence[str], shape: ObjectGeometry, gel: GelSensor
) -> list[Finding]:
    """Warnings about the contacts, the geometry and the sensor."""
    flagged: list[Finding] = []
    if left_out:
        flagged.append(("contacts_left_out", f"{len(left_out)} contacts are not good and were left out."))
    if shape.radius_mm is None and shape.shape != "flat":
        flagged.append(("radius_unknown", "The object's radius is unknown; its modulus grows with it: give radius_mm."))
    radii = [reading.radius_mm for reading in readings if reading.radius_mm is not None]
    widest = WIDEST_CONTACT * min(gel.width_mm, gel.height_mm) / 2
    if radii and max(radii) > widest:
        note = f"A contact of {max(radii):.3g} mm is wider than {widest:.3g} mm, 0.6 of the face: press less."
        flagged.append(("contact_too_wide", note))
    if radii and shape.radius_mm is not None and max(radii) > DEEPEST_CONTACT * shape.radius_mm:
        note = f"A contact of {max(radii):.3g} mm on a radius of {shape.radius_mm:.3g} mm is too deep: press less."
        flagged.append(("contact_too_deep", note))
    if gel.shape != "flat":
        note = f"The gel of {gel.name} is not flat: as a layer its compliance is only estimated."
        flagged.append(("gel_not_flat", note))
    forces = [reading.force_n for reading in readings if reading.force_n is not None]
    if forces and max(forces) < (1 + SAME_FORCE) * min(forces):
        flagged.append(("one_force", "All contacts have one force: a second one would test the model."))
    return flagged


def misfit_findings(misfit: float, freedom: int) -> list[Finding]:
    """Whether the readings contradict each other."""
    if freedom < 1:
        return []
    chance = float(scipy.stats.chi2.sf(misfit, freedom))
    if chance >= IMPROBABLE:
        return []
    note = (
        f"Forces, radii and dents contradict each other (chance below {probability_bound(chance)}): the object is not "
        "of that shape, or force, scale or sensor are wrong."
    )
    return [("model_does_not_fit", note)]
