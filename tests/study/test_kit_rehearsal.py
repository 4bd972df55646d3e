"""The first physical validation, rehearsed whole: kit, phantoms, bench tests, calibration, blinded readings, score.

The virtual instrument stands in for all that would be physical, and hides what nobody would know there. Phantoms are
those of the recipe, missed: moduli, spheres and depths are off, and a calliper with errors writes ``phantoms.csv``. The
bench tests come from another path than their evaluation: the ball from the polynomial of Dimitriadis and others (2002),
the cylinder from Ritz's method with fields that keep the volume, at a Poisson's ratio of 0.5 where the evaluation takes
0.49. The light follows a law of `benchmarks.lamp_laws`, which no estimate contains, and the calibration is that of
``tsis calibrate``. Readings are pressed through the codes of the plan, imported, opened once and scored.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
import pytest
from benchmarks.lamp_laws import calibrated_probe
from benchmarks.worlds import UnevenProbe
from numpy.polynomial import polynomial
from scipy.special import roots_legendre

import tsis
from tsis.files.atomic import write_durably
from tsis.files.tables import table_bytes
from tsis.inclusion import InclusionPrior
from tsis.mechanics.bench_tests import bonded_factor
from tsis.model.phantom import Inclusion, Phantom
from tsis.present.kit import score_page
from tsis.present.pdf import pdf_bytes
from tsis.study.folder import Study, new_study, open_study, read_seal, unblind
from tsis.study.kit import KIT, MODULUS_COLUMNS, ValidationScore, bench_moduli, kit_files, score_validation
from tsis.study.plan import TargetTruth
from tsis.study.readings import StudyInstrument, export_readings, import_readings, press_study, read_truth_table

if TYPE_CHECKING:
    from pathlib import Path

    from numpy.typing import NDArray

RECIPE_KPA = {"tissue": 5.0} | {item.batch: item.young_kpa for item in KIT if item.young_kpa is not None}
THICKNESS_MM = 30.0
BATCH_SD = 0.1  # of the logarithm of a batch's modulus, about the recipe
SPHERE_SD_MM, DEPTH_SD_MM, HEIGHT_SD_MM = 0.1, 0.3, 0.3  # of casting
CALLIPER_SD_MM, DEPTH_KNOWN_SD_MM = 0.05, 0.15  # of what is then measured
POISSON = 0.49
BALL_MM, PAD_MM, CYLINDER_MM, TALL_MM = 5.0, 15.0, 20.0, 15.0  # radius and thickness; diameter and height
TRAVEL_MM = np.linspace(0.1, 1.0, 10)
SPECIMENS = 3
SPECIMEN_SD, FORCE_SD, ZERO_SD_MM = 0.02, 0.005, 0.1  # of a specimen's modulus, of a reading, of the first contact
OPERATORS, DEVICE = ("A", "B"), "rehearsed probe"
N_PER_KPA_MM2 = 1e-3


@dataclass(frozen=True, slots=True, kw_only=True)
class Materials:
    """Batches as they came out, and what is made of them; moduli in kPa."""

    young_kpa: dict[str, float]
    targets: tuple[TargetTruth, ...]


def made_phantoms(rng: np.random.Generator) -> Materials:
    """Phantoms of the kit as a laboratory would cast them."""
    young = {name: value * float(np.exp(BATCH_SD * rng.standard_normal())) for name, value in RECIPE_KPA.items()}
    targets = []
    for item in KIT:
        tissue = Phantom(
            young_kpa=young["tissue"],
            thickness_mm=THICKNESS_MM + HEIGHT_SD_MM * float(rng.standard_normal()),
            poisson=POISSON,
        )
        if item.diameter_mm is not None and item.depth_mm is not None:
            lump = Inclusion(
                diameter_mm=item.diameter_mm + SPHERE_SD_MM * float(rng.standard_normal()),
                depth_mm=item.depth_mm + DEPTH_SD_MM * float(rng.standard_normal()),
                young_kpa=young[item.batch],
                poisson=POISSON,
            )
            tissue = replace(tissue, inclusion=lump)
        targets.append(TargetTruth(label=item.label, phantom=tissue))
    return Materials(young_kpa=young, targets=tuple(targets))


def measured_phantoms(made: Materials, rng: np.random.Generator) -> bytes:
    """``phantoms.csv``: sizes by calliper; the moduli of the recipe, for the bench tests replace them."""
    rows: list[list[object]] = [["label", "diameter_mm", "depth_mm", "young_kpa", "tissue_kpa", "thickness_mm"]]
    for item, target in zip(KIT, made.targets, strict=True):
        sizes: list[float | None] = [None, None, None]
        if target.phantom.inclusion is not None:
            sizes = [
                round(target.phantom.inclusion.diameter_mm + CALLIPER_SD_MM * float(rng.standard_normal()), 2),
                round(target.phantom.inclusion.depth_mm + DEPTH_KNOWN_SD_MM * float(rng.standard_normal()), 2),
                item.young_kpa,
            ]
        rows.append([target.label, *sizes, RECIPE_KPA["tissue"], round(target.phantom.thickness_mm, 1)])
    return table_bytes(rows)


def ball_force(young_kpa: float, travel_mm: NDArray[np.float64]) -> NDArray[np.float64]:
    """Force in N of a ball on a bonded incompressible pad, by the polynomial of Dimitriadis and others (2002)."""
    chi = np.sqrt(BALL_MM * travel_mm) / PAD_MM
    correction = polynomial.polyval(chi, [1.0, 1.133, 1.283, 0.769, 0.0975])
    return np.asarray(N_PER_KPA_MM2 * 16 / 9 * young_kpa * np.sqrt(BALL_MM) * travel_mm**1.5 * correction)


def held_cylinder_force(
    young_kpa: float, shortening_mm: NDArray[np.float64], *, diameter_mm: float, height_mm: float, terms: int = 8
) -> NDArray[np.float64]:
    """Force in N of an incompressible cylinder between plates that hold its ends, at small strain, by Ritz's method.

    The displacement is ``u_r = -r g'``, ``u_z = 2 g + r dg/dr`` of a polynomial ``g(r, z)``, so that the volume stays;
    the least elastic energy over `terms` powers each way gives the force.

    Examples
    --------
    >>> flat = held_cylinder_force(10.0, np.array([1.0]), diameter_mm=40.0, height_mm=4.0)  # beside Gent and Lindley's
    >>> round(float(flat[0] / (1e-3 * 10 * np.pi * 400 / 4 * (1 + 2 * 2.5**2))), 1)
    1.0
    """
    half, radius = height_mm / 2, diameter_mm / 2
    z, z_weight = roots_legendre(4 * terms)
    rho, rho_weight = roots_legendre(2 * terms)
    rho, rho_weight = (rho + 1) / 2, rho_weight / 2
    shapes = [_plates()] + [
        (np.asarray(polynomial.polymul([1.0, 0.0, -2.0, 0.0, 1.0], [0.0] * (2 * odd + 1) + [1.0])), 2 * power)
        for odd in range(terms)
        for power in range(terms)
    ]
    strains = np.stack([_strain(along, power, rho, z, radius, half) for along, power in shapes])
    weight = np.outer(rho * rho_weight, z_weight) * 2 * np.pi * radius**2 * half
    columns = (strains * np.sqrt(weight)).reshape(len(shapes), -1).T
    # The energy is the squared norm: the least of it over the free shapes is a problem of least squares.
    free, *_ = np.linalg.lstsq(columns[:, 1:], -columns[:, 0], rcond=1e-12)
    energy = young_kpa / 3 * float(np.sum((columns[:, 0] + columns[:, 1:] @ free) ** 2))  # of 1 mm; mu e:e, mu = E / 3
    return np.asarray(N_PER_KPA_MM2 * 2 * energy * shortening_mm)


def _plates() -> tuple[NDArray[np.float64], int]:
    """The cubic that moves the plates by half a millimetre each towards the other and leaves their faces at rest."""
    return np.array([0.0, -3.0, 0.0, 1.0]) / 8, 0


def _strain(
    along: NDArray[np.float64], power: int, rho: NDArray[np.float64], z: NDArray[np.float64], radius: float, half: float
) -> NDArray[np.float64]:
    """Strains of ``g = along(z) rho^power``, with the shear times the root of 2, shape (4, radii, heights)."""
    value, slope, bend = (polynomial.polyval(z, polynomial.polyder(along, order)) / half**order for order in range(3))
    r_power = rho**power
    radial, hoop, axial = -(1 + power) * r_power, -r_power, (2 + power) * r_power
    turn = (2 + power) * power * rho ** max(power - 1, 0) / radius  # of u_z over the radius
    shear = (np.outer(turn, value) - np.outer(radius * rho * r_power, bend)) / np.sqrt(2)
    return np.stack([np.outer(radial, slope), np.outer(hoop, slope), np.outer(axial, slope), shear])


def bench_table(made: Materials, rng: np.random.Generator) -> bytes:
    """``modulus.csv``: three pads and three cylinders of each batch under the ball and between the plates."""
    labels = {name: ";".join(item.label for item in KIT if item.batch == name) or name for name in made.young_kpa}
    rows: list[list[object]] = [list(MODULUS_COLUMNS)]
    unit = held_cylinder_force(1.0, TRAVEL_MM, diameter_mm=CYLINDER_MM, height_mm=TALL_MM)
    kinds = (
        ("indentation", BALL_MM, PAD_MM, ball_force(1.0, TRAVEL_MM)),
        ("compression", CYLINDER_MM, TALL_MM, unit),
    )
    for batch, young in made.young_kpa.items():
        for specimen in range(1, SPECIMENS + 1):
            for kind, size, thickness, force in kinds:
                own = young * float(np.exp(SPECIMEN_SD * rng.standard_normal()))
                start = abs(ZERO_SD_MM * float(rng.standard_normal()))
                readings = own * force * (1 + FORCE_SD * rng.standard_normal(len(force)))
                for reading, travel in zip(readings, TRAVEL_MM, strict=True):
                    cells = [round(float(reading), 6), round(float(travel) + start, 4)]
                    rows.append([labels[batch], specimen, kind, size, thickness, *cells])
    return table_bytes(rows)


def opened(folder: Path, targets: tuple[TargetTruth, ...], *, seed: int, probe: str, repeats: int) -> Study:
    """The study in a folder, or a new one of the ``targets``; one seed gives the same codes to the same labels."""
    if folder.exists():
        return open_study(folder)
    return new_study(folder, targets, seed=seed, probe=probe, repeats=repeats, name="kit", actor="maker")


def rehearse(
    folder: Path, *, law: str, probe_name: str, seed: int, repeats: int, strain: str
) -> tuple[Materials, ValidationScore]:
    """The whole validation in a folder; what is there already is taken up."""
    rng = np.random.default_rng([seed, 1])
    kit, made = folder / "kit", made_phantoms(rng)
    kit.mkdir(parents=True, exist_ok=True)
    filled = {"phantoms.csv": measured_phantoms(made, rng), "modulus.csv": bench_table(made, rng)}
    for name, content in {**kit_files(), **filled}.items():
        write_durably(kit / name, content)
    sealed = opened(
        folder / "study", read_truth_table(kit / "phantoms.csv"), seed=seed, probe=probe_name, repeats=repeats
    )
    if sealed.unblinded is None:
        on_bench = opened(folder / "bench", made.targets, seed=seed, probe=probe_name, repeats=repeats)
        _require_same_codes(sealed, on_bench)
        lamps = calibrated_probe(law, tsis.load_probe(probe_name), seed)
        virtual = UnevenProbe(
            tsis.load_probe(probe_name), rng=np.random.default_rng([seed, 2]), strain=strain, lamps=lamps
        )
        instrument = StudyInstrument(virtual=virtual, corrected=lamps.corrected)
        for operator in OPERATORS:
            on_bench = press_study(on_bench, operator=operator, seed=seed, strain=strain, instrument=instrument).study
        write_durably(folder / "readings.csv", export_readings(on_bench))
        sealed = import_readings(sealed, folder / "readings.csv", device=DEVICE, actor=OPERATORS[0])
        sealed = unblind(sealed, by=OPERATORS[0])
    score = score_validation(
        sealed,
        bench_moduli(kit / "modulus.csv", poisson=POISSON),
        device=DEVICE,
        diameter_sd_mm=CALLIPER_SD_MM,
        depth_sd_mm=DEPTH_KNOWN_SD_MM,
    )
    write_durably(folder / "score.pdf", pdf_bytes(score_page(score)))
    return made, score


def _require_same_codes(first: Study, second: Study) -> None:
    """Both studies call the same phantom by the same code."""
    labels = [{code: truth.label for code, truth in read_seal(study)[0].truths.items()} for study in (first, second)]
    assert labels[0] == labels[1], "remove the folder: its studies are of other seeds"


@pytest.mark.parametrize(("diameter", "height"), [(20.0, 15.0), (20.0, 10.0), (10.0, 30.0)])
def test_ritz_and_finite_elements_agree_on_a_held_cylinder(diameter: float, height: float) -> None:
    force = held_cylinder_force(10.0, np.array([1.0]), diameter_mm=diameter, height_mm=height, terms=8)
    free = 1e-3 * 10.0 * np.pi * diameter**2 / 4 / height
    expected = bonded_factor(diameter, height, 0.4999)
    assert expected < force[0] / free < 1.005 * expected  # a bound from above


@pytest.mark.slow
def test_the_bench_finds_the_moduli_within_what_poissons_ratio_moves(tmp_path: Path) -> None:
    rng = np.random.default_rng(3)
    made = made_phantoms(rng)
    (tmp_path / "phantoms.csv").write_bytes(measured_phantoms(made, rng))
    (tmp_path / "modulus.csv").write_bytes(bench_table(made, rng))
    found = bench_moduli(tmp_path / "modulus.csv")
    assert [found[label].young_kpa for label in ("1", "6", "tissue")] == pytest.approx(
        [made.young_kpa[batch] for batch in ("A", "B", "tissue")], rel=0.05
    )
    sealed = read_truth_table(tmp_path / "phantoms.csv")
    assert [target.has_inclusion for target in sealed] == [True] * 7 + [False] * 3
    prior = InclusionPrior()
    for target in made.targets:  # what is cast lies inside what is believed
        for name, value in target.values.items():
            low, high = getattr(prior, name)
            assert low < value < high


@pytest.mark.slow
def test_the_whole_validation_is_rehearsed(tmp_path: Path) -> None:
    folder = tmp_path / "kit"
    _, score = rehearse(folder, law="growing", probe_name="tsis-domed", seed=11, repeats=1, strain="small")
    by = {item.quantity: item for item in score.quantities}
    assert by["diameter_mm"].count == by["depth_mm"].count == by["young_kpa"].count >= 12
    # Depths are read more finely than the pours are known: the interval alone need not hold what was measured.
    assert all(item.hits_widened >= 9 for item in by.values())
    assert score.counts is not None
    assert score.counts.false_positives == 0
    assert not score.of_recipe
    assert score.faults == 0
    assert (folder / "score.pdf").read_bytes().startswith(b"%PDF")
    again = rehearse(folder, law="growing", probe_name="tsis-domed", seed=11, repeats=1, strain="small")[1]
    assert again.quantities == score.quantities  # a second run takes up what is there
