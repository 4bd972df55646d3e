"""No output prints a number of an estimate that must not be used; all print those that may be."""

from __future__ import annotations

import ast
import copy
import io
import json
import logging
import pickle
import re
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import h5py
import numpy as np
import pytest
import zarr
from matplotlib.figure import Figure
from matplotlib.patches import Rectangle
from matplotlib.text import Text
from rich.console import Console
from tests.present.pdf_readers import sheets
from tests.present.rough_pictures import rough_pictures
from tests.present.test_pages import a_press
from tests.records.sample import sample_record
from tests.records.variants import with_estimate

import tsis
from tsis.console.api.responses import estimate_item
from tsis.errors import NotIdentifiedError, UnknownNameError, UntrustedError
from tsis.hardness.table import build_contact_table
from tsis.inclusion import InclusionPrior
from tsis.model.estimate import Estimate
from tsis.present.document import estimate_document
from tsis.present.figures import posterior, tissue_section
from tsis.present.hardness import hardness_page
from tsis.present.html import html_bytes
from tsis.present.inclusion import estimate_table, inclusion_page
from tsis.present.pdf import pdf_bytes
from tsis.present.records import recomputation_document, shift_table
from tsis.present.target import target_page
from tsis.present.terminal import rich_table
from tsis.records.arrays import write_netcdf, write_zarr
from tsis.records.deidentification import deidentified
from tsis.records.dicom import dicom_files
from tsis.records.export import csv_files
from tsis.records.recomputation import Recomputation, _shifts

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

SOURCE = Path(tsis.__file__).parent
NAMES = ("diameter_mm", "depth_mm", "young_kpa")
# Packages of code that read withheld numbers: none of it prints them.
READS_WITHHELD = {
    "model/estimate.py",  # the values themselves
    "records/blobs.py",  # the store and its copies, from which estimates come back
    "records/deidentification.py",  # another estimate of the same samples
    "records/recomputation.py",  # equality bit for bit, and shifts of trusted estimates
    "records/arrays.py",  # samples for programs, in a group that is called untrusted
    "virtual/examinations.py",  # whether an interval holds a known truth, and no number of it
    "study/classifier.py",  # evidence on presence, whose trust is its own
    "mapping/lump_map.py",  # the map's own values
    "mapping/estimation.py",  # lumps as the flags of their map are raised
    "matching/registration.py",  # the match's own values
    "cli/match.py",  # behind --untrusted
    "hardness/strain_map.py",  # the source's method, which asks for no reliable match
}
# Means, spreads and ends of intervals that stand nowhere else: each has its own digits.
MIDDLE = {"diameter_mm": 8.3717, "depth_mm": 5.6139, "young_kpa": 77.293}
SPREAD = {"diameter_mm": 0.6871, "depth_mm": 0.4783, "young_kpa": 9.2433}
PRESENCE = 0.73519


@pytest.fixture(scope="module", autouse=True)
def _rough_pictures() -> Iterator[None]:
    """Spare the rendering of pictures, whose numbers are paths and pixels that nothing here reads."""
    with rough_pictures():
        yield


def planted(*, trusted: bool, flags: tuple[str, ...] = (), names: tuple[str, ...] = NAMES) -> Estimate:
    """An estimate whose texts have its numbers too, as those of earlier versions have."""
    even = np.linspace(-1.0, 1.0, 401)
    scale = {name: SPREAD[name] / float(np.std(even)) for name in names}
    samples = {name: MIDDLE[name] + scale[name] * even for name in names}
    texts = [f"the {name} is {MIDDLE[name]:.3g} ± {SPREAD[name]:.2g}" for name in names]
    return Estimate(
        samples=samples,
        prior_sd={name: InclusionPrior().sd[name] for name in names},
        cramer_rao_sd={name: 0.77123 * SPREAD[name] for name in names},
        presence=PRESENCE,
        log_bayes_factor=1.61803,
        identifiability="; ".join(texts),
        prior="uniform",
        trusted=trusted,
        flags=flags,
        notes=tuple(f"Not identified: {texts[-1]}." for _ in flags),
        provenance={"presses": [], "radius": {"radius_mm": 3.0}, "prior": {"poisson": [0.45, 0.49]}},
    )


def numbers(estimate: Estimate, names: tuple[str, ...] = NAMES) -> set[str]:
    """The digits of the numbers of an estimate, as three or more of them are printed."""
    posterior = estimate.untrusted
    values = [value for name in names for value in (posterior.mean[name], posterior.sd[name])]
    return {f"{value:.3g}" for value in values}


def ends(estimate: Estimate, names: tuple[str, ...] = NAMES) -> set[str]:
    return {f"{end:.3g}" for name in names for end in estimate.untrusted.interval(0.9)[name]}


def printed_of(numbers: set[str], text: str) -> set[str]:
    """Those of the numbers that a text prints, with these or more digits."""
    return {number for number in numbers if re.search(rf"(?<![\w.]){re.escape(number)}", text)}


def texts_of(presence: float) -> set[str]:
    return {f"{presence:.3g}"}


def console(estimate: Estimate) -> str:
    table = Console(file=io.StringIO(), width=240)
    table.print(rich_table(estimate_table(estimate, title="estimate")))
    assert isinstance(table.file, io.StringIO)
    return table.file.getvalue()


def inclusion_html(estimate: Estimate) -> str:
    page = inclusion_page(
        estimate,
        title="A title",
        subtitle="",
        targets=[a_press("target", 30.0)],
        references=[],
        prior=InclusionPrior(),
        ring_edges_mm=np.linspace(0.0, 9.0, 10),
    )
    return re.sub(r'(base64,|<path[^>]* d=")[^"]*"', "", html_bytes(page).decode())


def hardness_html(estimate: Estimate) -> str:
    of_modulus = planted(trusted=estimate.trusted, flags=estimate.flags, names=("young_kpa",))
    table = build_contact_table(tsis.load_probe("tsis-2011"))
    press = {
        "force_n": 0.5,
        "ball_radius_mm": None,
        "name": "",
        "seen": {"radius_mm": 2.0, "radius_sd": 0.01, "light_force_n": 0.5},
    }
    provenance = dict(of_modulus.provenance) | {"presses": [press]}
    page = hardness_page(
        replace(of_modulus, identifiability=estimate.identifiability, notes=estimate.notes, provenance=provenance),
        title="A title",
        images=[a_press("target", 30.0)],
        table=table,
        provenance={},
    )
    return re.sub(r'(base64,|<path[^>]* d=")[^"]*"', "", html_bytes(page).decode())


def target_text(estimate: Estimate) -> str:
    return re.sub(r'(base64,|<path[^>]* d=")[^"]*"', "", html_bytes(target_page(stored(estimate))).decode())


def target_pdf(estimate: Estimate, folder: Path) -> str:
    folder.mkdir(exist_ok=True)
    return "\n".join(sheets(pdf_bytes(target_page(stored(estimate))), folder))


def stored(estimate: Estimate) -> Any:
    return with_estimate(replace(sample_record(), estimates=()), estimate)


def dicom(estimate: Estimate) -> str:
    return str(dicom_files(stored(estimate))[-1].dataset())


def attributes_netcdf(estimate: Estimate, folder: Path) -> str:
    folder.mkdir(exist_ok=True)
    write_netcdf(stored(estimate), folder / "target.nc")
    said: list[str] = []
    with h5py.File(folder / "target.nc") as file:
        file.visititems(lambda name, node: said.append(f"{name} {dict(node.attrs)}"))
    return "\n".join(said)


def attributes_zarr(estimate: Estimate, folder: Path) -> str:
    folder.mkdir(exist_ok=True)
    write_zarr(stored(estimate), folder / "target.zarr")
    nodes = zarr.open_group(folder / "target.zarr", mode="r").members(max_depth=None)
    return "\n".join(f"{name} {dict(node.attrs)}" for name, node in nodes)


def recomputed(estimate: Estimate) -> str:
    (before,) = stored(planted(trusted=True)).estimates
    (after,) = stored(estimate).estimates
    item = Recomputation(
        before=before,
        after=after,
        same=False,
        shifts=_shifts(before.estimate, after.estimate),
        causes=(),
        notes=(),
        stored=True,
    )
    target = sample_record().target
    return f"{shift_table(item)} {json.dumps(recomputation_document(target, item))}"


def drawn(estimate: Estimate) -> str:
    """Words of the figures of an estimate, and where what they draw begins and ends."""
    section = Figure()
    tissue_section(estimate, section.subplots())
    said: list[str] = []
    for part in (*posterior(estimate).findobj(), *section.findobj()):
        if isinstance(part, Text):
            said.append(part.get_text())
        elif isinstance(part, Rectangle) and part.axes is not None and part is not part.axes.patch:
            said += [f"{end:.5g}" for end in (part.get_x(), part.get_x() + part.get_width())]
    return "\n".join(said)


def error_text(estimate: Estimate) -> str:
    try:
        return repr(estimate.mean)
    except UntrustedError as error:
        return str(error)


OUTPUTS: dict[str, Callable[[Estimate, Path], str]] = {
    "repr": lambda estimate, _: repr(estimate),
    "notebook": lambda estimate, _: estimate._repr_html_(),
    "error": lambda estimate, _: error_text(estimate),
    "json": lambda estimate, _: json.dumps(estimate_document(estimate)),
    "http": lambda estimate, _: estimate_item(stored(estimate).estimates[0], {}).model_dump_json(),
    "figures": lambda estimate, _: drawn(estimate),
    "terminal": lambda estimate, _: console(estimate),
    "page of an inclusion": lambda estimate, _: inclusion_html(estimate),
    "page of a hardness": lambda estimate, _: hardness_html(estimate),
    "page of a target": lambda estimate, _: target_text(estimate),
    "pdf of a target": target_pdf,
    "csv": lambda estimate, _: csv_files(stored(estimate))["estimates.csv"].decode(),
    "csv, de-identified": lambda estimate, _: csv_files(deidentified(stored(estimate)))["estimates.csv"].decode(),
    "dicom": lambda estimate, _: dicom(estimate),
    "netcdf": attributes_netcdf,
    "zarr": attributes_zarr,
    "recomputation": lambda estimate, _: recomputed(estimate),
}


NAMES_OF_OUTPUTS = [pytest.param(name, marks=pytest.mark.system if name.startswith("pdf") else ()) for name in OUTPUTS]


@pytest.mark.parametrize("name", NAMES_OF_OUTPUTS)
def test_a_trusted_estimate_prints_its_numbers(name: str, tmp_path: Path) -> None:
    """Else the next tests would pass on empty outputs."""
    estimate = planted(trusted=True)
    printed = OUTPUTS[name](estimate, tmp_path)
    assert printed_of(numbers(estimate) | ends(estimate), printed)


@pytest.mark.parametrize("name", NAMES_OF_OUTPUTS)
def test_an_untrusted_estimate_prints_no_number(name: str, tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    estimate = planted(trusted=False, flags=("young_kpa_not_identified",))
    with caplog.at_level(logging.DEBUG, "tsis"):
        printed = OUTPUTS[name](estimate, tmp_path) + caplog.text
    assert not printed_of(numbers(estimate) | ends(estimate) | texts_of(PRESENCE), printed)


@pytest.mark.parametrize("name", NAMES_OF_OUTPUTS)
def test_notes_of_earlier_versions_print_no_withheld_presence(name: str, tmp_path: Path) -> None:
    flags = ("inclusion_uncertain", "off_axis")
    notes = (f"Whether there is an inclusion is uncertain: probability {PRESENCE:.2g}.", "Off the axis.")
    estimate = replace(planted(trusted=False, flags=flags), notes=notes)
    assert not printed_of({f"{PRESENCE:.2g}"}, OUTPUTS[name](estimate, tmp_path))
    more_notes = replace(estimate, notes=(*notes, "The modulus lies in 52.1 to 87.9 kPa."))
    assert not printed_of({f"{PRESENCE:.2g}", "52.1"}, OUTPUTS[name](more_notes, tmp_path / "again"))


@pytest.mark.parametrize("flags", [("off_axis",), ("no_inclusion",), ()])
def test_a_presence_is_trusted_without_an_inclusion_alone(flags: tuple[str, ...]) -> None:
    trusted = planted(trusted=True)
    assert trusted.presence_trusted
    again = replace(trusted, trusted=False, flags=flags)
    assert again.presence_trusted == (flags == ("no_inclusion",))
    assert (f"{PRESENCE:.3g}" in again._repr_html_()) == again.presence_trusted


def test_values_by_parameter_keep_withholding() -> None:
    mean: Any = planted(trusted=True, flags=("young_kpa_not_identified",)).mean
    assert mean.get("young_kpa") is None
    with pytest.raises(UnknownNameError):
        mean.get("typo")
    for again in (mean.copy(), copy.deepcopy(mean), pickle.loads(pickle.dumps(mean))):
        assert again == mean
        with pytest.raises(NotIdentifiedError):
            again["young_kpa"]
    with pytest.raises(TypeError):
        mean["young_kpa"] = 1.0
    with pytest.raises(TypeError):
        mean | {}


@pytest.mark.parametrize("name", NAMES_OF_OUTPUTS)
def test_a_parameter_that_is_not_identified_has_no_mean(name: str, tmp_path: Path) -> None:
    estimate = replace(
        planted(trusted=True, flags=("young_kpa_not_identified",)), identifiability="", notes=("A note.",)
    )
    printed = OUTPUTS[name](estimate, tmp_path)
    assert not printed_of(numbers(estimate, ("young_kpa",)), printed)


def test_withheld_numbers_are_read_nowhere_else() -> None:
    """An output can only print them by the attribute `untrusted`."""
    readers = {
        str(path.relative_to(SOURCE))
        for path in SOURCE.rglob("*.py")
        if ".untrusted" in (source := path.read_text(encoding="utf-8"))
        for node in ast.walk(ast.parse(source))
        if isinstance(node, ast.Attribute) and node.attr == "untrusted"
    }
    assert readers <= READS_WITHHELD


@pytest.mark.parametrize("name", ["mean", "sd", "samples", "narrowing"])
def test_the_numbers_of_an_untrusted_estimate_raise(name: str) -> None:
    estimate = replace(planted(trusted=False, flags=("off_axis",)), notes=("Move the probe over it.",))
    with pytest.raises(UntrustedError, match=r"off_axis.*Move the probe over it\..*untrusted"):
        getattr(estimate, name)
    with pytest.raises(UntrustedError, match="off_axis"):
        estimate.interval()
    assert getattr(estimate.untrusted, name)["depth_mm"] is not None
    assert estimate.presence == PRESENCE
    assert not estimate.presence_trusted


@pytest.mark.parametrize("name", ["mean", "sd"])
def test_the_mean_of_what_is_not_identified_raises(name: str) -> None:
    estimate = planted(trusted=True, flags=("young_kpa_not_identified",))
    values = getattr(estimate, name)
    with pytest.raises(NotIdentifiedError, match="young_kpa"):
        values["young_kpa"]
    assert set(values) == {"diameter_mm", "depth_mm"}
    assert "young_kpa" in estimate.interval()
    assert estimate.samples["young_kpa"].size == 401


@pytest.mark.parametrize("call", ["mean", "sd", "samples", "narrowing", "interval", "identified"])
def test_an_unknown_name_raises_with_the_list_of_names(call: str) -> None:
    estimate = planted(trusted=True)
    found = getattr(estimate, call)
    values = found() if call == "interval" else found
    with pytest.raises(UnknownNameError, match="depth_mm, diameter_mm, young_kpa"):
        values("E") if call == "identified" else values["E"]
