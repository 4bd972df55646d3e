"""Simulated cases kept on disk, so that another estimator judges the same frames in minutes.

    python -m benchmarks.press_bank --protocol domed --presses 2000 --seed 1 --folder /tmp/bank

Makes the cases that are missing, one after the other; `benchmarks.coverage --frames` reads them and makes what is
missing itself. A folder holds one file a case, 0.4 MB a frame, and ``bank.json``, which says what was simulated.
"""

from __future__ import annotations

import io
import json
import sys
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from benchmarks.harness import Bench, Choice
from benchmarks.simulated_presses import DEFAULT, DRAWN, PROTOCOLS, Protocol, SimulatedCase, simulate
from benchmarks.worlds import WORLDS, World, seen_by_product, simulate_world

import tsis
from tsis.cli.progress import progress_bar
from tsis.errors import MechanicsError
from tsis.files.atomic import remove_unfinished, write_durably
from tsis.imaging.sensor import Sensor
from tsis.inclusion import InclusionPrior
from tsis.model.image import TactileImage
from tsis.model.phantom import Inclusion, Phantom
from tsis.optics.face_light import irradiance
from tsis.virtual.probe import nominal_calibration

if TYPE_CHECKING:
    from tsis.model.calibration import Calibration


@dataclass(frozen=True, slots=True, kw_only=True)
class PressBank:
    """Cases of one protocol and one seed: read where they are kept, simulated (and kept, given a folder) where not.

    Attributes
    ----------
    protocol, prior, seed
        What is simulated.
    world, blank
        What differs from the estimator's model, and whether the inclusion is left out.
    folder
        Where the protocol's folders lie; nothing is kept when None.
    """

    protocol: Protocol
    prior: InclusionPrior
    seed: int
    world: World = WORLDS["as-model"]
    blank: bool = False
    folder: Path | None = None

    def __post_init__(self) -> None:
        if self.folder is None:
            return
        result = json.dumps(self.content(), indent=2)
        note = self._place / "bank.json"
        if note.exists() and note.read_text() != result:
            raise SystemExit(
                f"{self._place} holds presses that were simulated otherwise (see {note}): give another folder"
            )
        self._place.mkdir(parents=True, exist_ok=True)
        remove_unfinished(self._place)
        write_durably(note, result.encode())

    @property
    def _place(self) -> Path:
        assert self.folder is not None  # callers have asked
        return self.folder / f"{self.name}-{self.seed}"

    @property
    def name(self) -> str:
        """Protocol, world and whether blank."""
        world = "" if self.world == WORLDS["as-model"] else f"-{self.world.name}"
        return f"{self.protocol.name}{world}{'-blank' if self.blank else ''}"

    @property
    def strain(self) -> str:
        """Mechanics of the presses."""
        return "finite" if "finite" in (self.world.strain, self.protocol.strain) else "small"

    def content(self) -> dict[str, Any]:
        """What decides the frames, but for the code that makes them."""
        known = believed(self.protocol)
        light = None if known.light is None else known.light.sha256
        differs = {} if self.name == self.protocol.name else {"world": asdict(self.world), "blank": self.blank}
        return differs | {
            "tsis": tsis.__version__,
            "seed": self.seed,
            "protocol": asdict(self.protocol),
            "probe": asdict(self.protocol.probe),
            "drawn from": {name: getattr(self.prior, name) for name in DRAWN},
            "calibration": asdict(replace(known, light=None)) | {"light": light},
        }

    def case(self, index: int) -> SimulatedCase:
        """Case ``index``; a MechanicsError where the drawn tissue is too soft for the mechanics."""
        return seen_by_product(self.world, self.protocol, self.raw(index), seed=self.seed)

    def raw(self, index: int) -> SimulatedCase:
        """Case ``index`` before the product corrects its frames for lamps."""
        if self.folder is None:
            return self._simulated(index)
        path = self._place / f"{index:06d}.npz"
        if path.exists():
            return _read(path.read_bytes(), believed(self.protocol))
        case = self._simulated(index)
        write_durably(path, _bytes(case))
        return case

    def _simulated(self, index: int) -> SimulatedCase:
        if self.name == self.protocol.name:
            return simulate(self.protocol, self.prior, seed=self.seed, index=index)
        return simulate_world(self.world, self.protocol, self.prior, seed=self.seed, index=index, blank=self.blank)


def believed(protocol: Protocol) -> Calibration:
    """What every virtual probe of the protocol is believed to answer."""
    probe = protocol.probe
    return replace(nominal_calibration(Sensor(), irradiance(probe)), probe=probe.name)


def _bytes(case: SimulatedCase) -> bytes:
    every = (*case.frames, *case.references)
    about = {
        "phantom": asdict(case.phantom),
        "targets": len(case.frames),
        "frames": [
            {
                "force_n": one.force_n,
                "mm_per_pixel": one.mm_per_pixel,
                "full_scale": one.full_scale,
                "name": one.name,
                "settings": dict(one.settings),
            }
            for one in every
        ],
    }
    file = io.BytesIO()
    np.savez(file, grey=np.array([one.grey for one in every], dtype=np.uint8), about=np.array(json.dumps(about)))
    return file.getvalue()


def _read(content: bytes, calibration: Calibration) -> SimulatedCase:
    with np.load(io.BytesIO(content)) as file:
        about, grey = json.loads(str(file["about"])), file["grey"]
    frames = tuple(TactileImage(grey=one, **result) for one, result in zip(grey, about["frames"], strict=True))
    phantom = about["phantom"]
    inclusion = phantom["inclusion"]
    return SimulatedCase(
        phantom=Phantom(**phantom | {"inclusion": inclusion and Inclusion(**inclusion)}),
        frames=frames[: about["targets"]],
        references=frames[about["targets"] :],
        calibration=calibration,
    )


def main() -> int:
    """Make what is missing, in this process alone."""
    bench = Bench(__doc__, protocol=Choice(PROTOCOLS, DEFAULT), presses=2000, seed=1, folder=Path)
    bank = PressBank(protocol=PROTOCOLS[bench.protocol], prior=InclusionPrior(), seed=bench.seed, folder=bench.folder)
    with progress_bar("pressing") as progress:
        for index in range(bench.presses):
            try:
                bank.case(index)
            except MechanicsError as error:
                print(f"case {index}: {error}")
            progress(index + 1, bench.presses)
    return bench.end()


if __name__ == "__main__":
    sys.exit(main())
