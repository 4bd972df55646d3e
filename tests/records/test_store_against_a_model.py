"""Whatever is done with a store in whatever order, it holds what a plain dictionary would hold."""

from __future__ import annotations

import shutil
import tempfile
from dataclasses import dataclass, field, replace
from datetime import timedelta
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
from hypothesis import settings
from hypothesis import strategies as st
from hypothesis.stateful import Bundle, RuleBasedStateMachine, consumes, initialize, invariant, multiple, rule
from tests.records.sample import WHEN, sample_calibration, sample_estimate

from tsis.errors import InputError, StaleRecordError
from tsis.model.image import TactileImage
from tsis.records.store import open_store, verify_store

if TYPE_CHECKING:
    from tsis.records.values import StoredEstimate, StoredPress, Target

WORDS = st.text(st.characters(categories=("L", "N", "P", "S")), max_size=8)
CALIBRATIONS = tuple(replace(sample_calibration(), name=name) for name in ("one", "two"))


@dataclass
class Held:
    """What the model knows of a target."""

    target: Target
    presses: dict[str, tuple[StoredPress, np.ndarray[Any, Any]]] = field(default_factory=dict)
    estimates: list[StoredEstimate] = field(default_factory=list)


class StoreMachine(RuleBasedStateMachine):
    """A store beside dictionaries; every value that was ever given out may be used again, stale ones too."""

    targets, presses = Bundle("targets"), Bundle("presses")

    @initialize()
    def begin(self) -> None:
        self.folder = Path(tempfile.mkdtemp(prefix="tsis-store-"))
        self.store = open_store(self.folder, actor="model")
        self.held: dict[str, Held] = {}

    @rule(
        target=targets,
        name=WORDS,
        number=st.none() | st.integers(1, 6),
        truth=st.dictionaries(WORDS.filter(bool), st.floats(0, 9)),
    )
    def add_target(self, name: str, number: int | None, truth: dict[str, float]) -> Any:
        taken = {each.target.number for each in self.held.values()}
        if number in taken:
            with pytest.raises(InputError, match="is taken"):
                self.store.add_target(number=number, name=name, truth=truth)
            return multiple()
        added = self.store.add_target(number=number, name=name, truth=truth)
        assert added.number == (max(taken, default=0) + 1 if number is None else number)
        assert (added.name, dict(added.truth)) == (name, truth)
        self.held[added.id] = Held(added)
        return added

    @rule(
        target=presses,
        of=targets,
        seed=st.integers(0, 3),
        seconds=st.integers(-5, 5),
        calibration=st.sampled_from([None, *CALIBRATIONS]),
        note=WORDS,
        force=st.none() | st.floats(0, 100),
    )
    def add_press(
        self, of: Target, seed: int, seconds: int, calibration: Any, note: str, force: float | None
    ) -> StoredPress:
        grey = np.random.default_rng(seed).integers(0, 256, (3, 4))
        image = TactileImage(grey=grey.astype(float), full_scale=255.0, force_n=force, settings={"seed": seed})
        taken = WHEN + timedelta(seconds=seconds)
        press = self.store.add_press(of, image, taken=taken, calibration=calibration, note=note)
        assert (press.taken, press.force_n, press.note, press.target) == (taken, force, note, of.id)
        self.held[of.id].presses[press.id] = (press, grey)
        return press

    @rule(of=targets, which=st.integers(0, 1))
    def add_estimate(self, of: Target, which: int) -> None:
        held = self.held[of.id]
        presses = [press for press, _ in held.presses.values()]
        supersedes = held.estimates[-1] if held.estimates else None
        made = sample_estimate()
        small = replace(
            made, untrusted=replace(made.untrusted, samples={name: values[:3] for name, values in made.samples.items()})
        )
        added = self.store.add_estimate(
            of,
            small,
            kind="inclusion",
            presses=presses,
            probe="tsis-2011",
            calibration=CALIBRATIONS[which],
            supersedes=supersedes,
        )
        held.estimates.append(added)

    @rule(target=targets, of=targets, name=WORDS)
    def edit_target(self, of: Target, name: str) -> Any:
        held = self.held[of.id]
        if of.version != held.target.version:
            with pytest.raises(StaleRecordError):
                self.store.edit_target(of, name=name)
            return multiple()
        held.target = self.store.edit_target(of, name=name)
        assert held.target == replace(of, name=name, version=of.version + 1)
        return held.target

    @rule(target=presses, of=consumes(presses), force=st.floats(0, 9), flags=st.lists(WORDS, max_size=2).map(tuple))
    def edit_press(self, of: StoredPress, force: float, flags: tuple[str, ...]) -> Any:
        held = self.held[of.target].presses
        edited = self.store.edit_press(of, force_n=force, flags=flags)
        held[of.id] = (edited, held[of.id][1])
        with pytest.raises(StaleRecordError):
            self.store.edit_press(of, force_n=force)
        return edited

    @rule()
    def reopen(self) -> None:
        self.store.close()
        self.store = open_store(self.folder, create=False, actor="model")

    @rule()
    def verify(self) -> None:
        found = verify_store(self.store)
        assert found.faults == ()
        assert (found.unnamed, found.unanchored) == (0, 0)

    @rule(of=targets)
    def look_into_a_target(self, of: Target) -> None:
        held = self.held[of.id]
        target_record = self.store.record(self.store.target(held.target.number))
        assert target_record.target == held.target
        for press in target_record.presses:
            np.testing.assert_array_equal(target_record.levels(press), held.presses[press.id][1])
        assert [each.id for each in target_record.estimates] == [each.id for each in held.estimates]
        assert [each.supersedes for each in target_record.estimates] == [each.supersedes for each in held.estimates]

    @invariant()
    def it_lists_what_the_model_holds(self) -> None:
        summaries = self.store.targets()
        expected = sorted(self.held.values(), key=lambda each: each.target.number)
        assert [(each.target, each.presses, each.estimates) for each in summaries] == [
            (each.target, len(each.presses), len(each.estimates)) for each in expected
        ]
        for held in expected:
            in_order = sorted((press for press, _ in held.presses.values()), key=lambda press: (press.taken, press.id))
            assert list(self.store.presses(held.target)) == in_order

    def teardown(self) -> None:
        if hasattr(self, "store"):
            self.store.close()
            shutil.rmtree(self.folder)


TestStoreAgainstAModel = StoreMachine.TestCase
TestStoreAgainstAModel.settings = settings(max_examples=15, stateful_step_count=20)
