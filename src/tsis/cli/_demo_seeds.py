"""``tsis demo --seeds N``: repeat the demo with everything drawn anew, and count how often the intervals held."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import tsis
from tsis.cli._output import print_json
from tsis.cli._progress import progress_bar
from tsis.present.page import Table
from tsis.present.terminal import print_tables

if TYPE_CHECKING:
    from collections.abc import Mapping

    from tsis.inclusion import InclusionPrior
    from tsis.model.probe import Probe

CONFIDENCE = 0.95


def repeat_demo(
    count: int,
    *,
    first_seed: int,
    probe: Probe,
    prior: InclusionPrior,
    forces_n: list[float],
    strain: str,
    as_json: bool,
) -> None:
    """Run the examinations, print the counts, and as JSON each case too."""
    examination = tsis.virtual.examinations.RepeatedExamination(
        probe=probe, prior=prior, forces_n=tuple(forces_n), strain=strain
    )
    with progress_bar(f"examining {count} virtual phantoms") as advance:
        cases = examination.run(count, first_seed=first_seed, progress=advance)
    counts = tsis.virtual.examinations.coverage_counts(cases)
    protocol: dict[str, Any] = {
        "probe": probe.name,
        "prior": prior_name(prior),
        "forces_n": list(forces_n),
        "strain": strain,
        "first_seed": first_seed,
    }
    protocol["command"] = _command(count, protocol)
    if as_json:
        print_json(
            tsis.present.document.envelope("demo", "seeds", protocol=protocol, counts=counts, examinations=cases)
        )
        return
    title = f"{count} examinations; {probe.name}, prior {protocol['prior']}"
    print_tables([_table(counts, title)], coverage_notes(counts))


def prior_name(prior: InclusionPrior) -> str:
    """The name of a prior; the default one has that of its file."""
    return prior.name or str(tsis.catalog.priors.list_inclusion_priors()[0])


def is_default_protocol(protocol: Mapping[str, Any]) -> bool:
    """Whether probe, prior, forces and strain are those of the stored run."""
    stored = tsis.virtual.examinations.stored_coverage()["protocol"]
    return all(protocol[name] == stored[name] for name in ("probe", "prior", "forces_n", "strain"))


def _command(count: int, protocol: Mapping[str, Any]) -> str:
    """The command that repeats a run: what differs from the defaults is named."""
    command = f"tsis demo --seeds {count} --seed {protocol['first_seed']}"
    if is_default_protocol(protocol):
        return command
    options = [("--probe", protocol["probe"]), ("--prior", protocol["prior"]), ("--strain", protocol["strain"])]
    options += [("--force-n", f"{force:g}") for force in protocol["forces_n"]]
    return " ".join([command, *(f"{name} {value}" for name, value in options)])


def _table(counts: Mapping[str, Any], title: str) -> Table:
    rows = []
    for kind, total in (("held", counts["answered"]), ("held_trusted", counts["trusted"])):
        for level, hits in counts[kind].items():
            which = "all" if kind == "held" else "trusted"
            shares = (_percentage(count, total) for count in hits.values())
            rows.append((f"{float(level):.0%}, {which} {total}", *shares))
    labels = (tsis.present.labels.quantity_of(name).label for name in tsis.inclusion.prior.PARAMETERS)
    return Table(title=title, columns=("interval", *(f"{label} held" for label in labels)), values=tuple(rows))


def _percentage(hits: int, total: int) -> str:
    """A share in per cent with its interval of 95 %, as Clopper and Pearson give it."""
    from scipy.stats import binomtest  # a start of the program loads no numerical library

    if total == 0:
        return ""
    among = binomtest(hits, total).proportion_ci(CONFIDENCE)
    return f"{100 * hits / total:.0f} % ({100 * among.low:.0f} to {100 * among.high:.0f})"


def coverage_notes(counts: Mapping[str, Any]) -> list[str]:
    """Messages about estimates that were untrusted or refused."""
    notes = [f"{counts['answered'] - counts['trusted']} of {counts['answered']} estimates are untrusted."]
    refused = sum(counts["refused"].values())
    if refused:
        reasons = ", ".join(f"{name} {count}" for name, count in counts["refused"].items())
        notes.append(f"{refused} of {counts['cases']} examinations were refused: {reasons}.")
    return notes


def stored_note() -> str:
    """One sentence on the stored run of 100 examinations: how often the intervals of 90 % held."""
    stored = tsis.virtual.examinations.stored_coverage()
    counts = stored["counts"]
    hits = ", ".join(f"{name} {count}" for name, count in counts["held"]["0.9"].items())
    return (
        f"With everything drawn anew, the 90 % interval held in so many of {counts['answered']} examinations: {hits} "
        f"({stored['protocol']['command']}, tsis {stored['tsis']})."
    )
