"""Stores to tamper with, and what `tsis.records.store.verify_store` makes of them."""

from __future__ import annotations

import shutil
from dataclasses import dataclass, replace
from datetime import timedelta
from typing import TYPE_CHECKING

import numpy as np
from tests.records.forger import Stores, UnchangedError
from tests.records.sample import WHEN, levels, sample_calibration, sample_estimate

from tsis.errors import RecordsError
from tsis.model.image import TactileImage
from tsis.records.store import open_store, verify_store

if TYPE_CHECKING:
    import random
    from collections.abc import Callable
    from pathlib import Path

    from tsis.records.store import Store

MOST_TRIES = 100


@dataclass(frozen=True, slots=True)
class Judgement:
    """How a tampering showed: in faults, in a refusal to open or read, not at all, or in another error."""

    faults: tuple[str, ...] = ()
    refusal: str = ""
    error: str = ""

    @property
    def found(self) -> bool:
        return bool(self.faults or self.refusal)


def make_stores(folder: Path) -> Stores:
    """An honest store with all kinds of records, an earlier copy, and another."""
    stores = Stores(folder / "store", folder / "earlier", folder / "other")
    with open_store(stores.store, actor="me") as store:
        fill(store, 0, targets=2)
    shutil.copytree(stores.store, stores.earlier)
    with open_store(stores.store, actor="me") as store:
        fill(store, 10, targets=1)
    with open_store(stores.other, actor="somebody else") as store:
        fill(store, 20, targets=3)
    return stores


def fill(store: Store, seed: int, *, targets: int = 1) -> None:
    """Add targets with presses and an estimate each, and change some of it."""
    for number in range(seed, seed + targets):
        target = store.add_target(name=f"size {number}", truth={"diameter_mm": 8.0 + 0.01 * number})
        known = replace(sample_calibration(), name=f"bench {number}")
        presses = []
        for at in range(4):
            image = TactileImage(
                grey=levels(100 * number + at)[40:56, 60:80],
                full_scale=255.0,
                force_n=0.1 + at,
                mm_per_pixel=(0.1, 0.1) if at else None,
                settings={"exposure_ms": 1.0 + at},
                name=f"{at}.png",
            )
            taken = WHEN + timedelta(seconds=at + 60 * number)
            flags = ("moving",) if at == 1 else ()
            presses.append(store.add_press(target, image, taken=taken, calibration=known, flags=flags))
        made = sample_estimate()
        samples = {name: np.asarray(values)[:20] + number for name, values in made.samples.items()}
        found = replace(made, untrusted=replace(made.untrusted, samples=samples))
        store.add_estimate(target, found, kind="inclusion", presses=presses, probe="tsis-2011", calibration=known)
        store.edit_target(target, note="edited")
        store.edit_press(presses[0], force_n=0.5)


def tampered(
    template: Stores, folder: Path, kind: Callable[[Stores, random.Random], None], rng: random.Random
) -> Stores:
    """A copy of the stores with one tampering that changed something."""
    for _ in range(MOST_TRIES):
        shutil.rmtree(folder, ignore_errors=True)
        shutil.copytree(template.store, folder)
        stores = replace(template, store=folder)
        try:
            kind(stores, rng)
        except UnchangedError:
            continue
        return stores
    raise AssertionError(f"{kind.__name__} changed nothing in {MOST_TRIES} tries")


def judged(folder: Path) -> Judgement:
    """What opening and verifying say of a store."""
    try:
        return _opened(folder, "phantom")
    except RecordsError as error:
        refusal = str(error)
    except Exception as error:  # every kind: this is what must not happen
        return Judgement(error=f"{type(error).__name__}: {error}")
    if "it is one of subjects" not in refusal:
        return Judgement(refusal=refusal)
    return _opened(folder, "subject")


def _opened(folder: Path, kind: str) -> Judgement:
    with open_store(folder, kind=kind, create=False) as store:
        return Judgement(faults=verify_store(store).faults)
