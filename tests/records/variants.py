"""Records of every kind that an export may meet, made from the sample, and bundles in memory."""

from __future__ import annotations

import hashlib
import json
from dataclasses import replace
from datetime import timedelta
from typing import TYPE_CHECKING, Any

import numpy as np
from tests.records.sample import SECRET, WHEN, sample_estimate, sample_record

from tsis.calibration.file import ProbeCalibration, calibration_sha256
from tsis.files.json_values import to_json_value
from tsis.model.calibration import Calibration
from tsis.model.estimate import Estimate, PosteriorSamples
from tsis.records.target import _write, sealed_bytes
from tsis.records.values import StoredEstimate, StoredPress, Target, TargetRecord, estimate_to_json

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from numpy.typing import NDArray


NAME, NOTE, FRAME = "Zwölf-Ünïcode 触覚 ^=\\ label", "seen by Nurse Quibble\non ward 7", "frame-Quagmire.png"
SETTING = "bench-of-Quentin"
PROBE, FLAG, CALIBRATION, CAMERA = "quill", "quorn-said-no", "calibration of Quasimodo", "camera of Quincy"
PARAMETER, TARGET_ID = "quaintness_mm", "target-of-quixote"
# Each word of what identifies, as it could be written: no export that is de-identified may hold one in any letters.
SECRETS = (
    *("Zwölf", "Ünïcode", "触覚", "label", "Nurse", "Quibble", "Quagmire", "Quentin"),
    *("Quill", "Quorn", "Quasimodo", "Quincy", "Quaint", "Quixote", "press-0", "estimate-b", "estimate-of"),
)


def framed(frames: Sequence[NDArray[Any]], **known: Any) -> TargetRecord:
    """A target of which frames of any size and depth were taken, a second apart, with their presses' fields."""
    levels = {hashlib.sha256(repr(i).encode()).hexdigest(): frame for i, frame in enumerate(frames)}
    given = {"role": "target", "full_scale": 255.0, "axis_px": (0.0, 0.0), **known}
    presses = tuple(
        StoredPress(
            taken=WHEN + timedelta(seconds=i),
            frame=name,
            rows=frame.shape[0],
            columns=frame.shape[1],
            id=f"press-{i}",
            target="target-b",
            **given,
        )
        for i, (name, frame) in enumerate(levels.items())
    )
    target = Target(number=7, kind="phantom", name="any", made=WHEN, id="target-b")
    return TargetRecord(target=target, presses=presses, read=levels.__getitem__, secret=SECRET)


def noise(rows: int, columns: int, *, bits: int = 8, seed: int = 0) -> NDArray[Any]:
    """A frame of any size that uses every bit."""
    kind = np.uint8 if bits <= 8 else np.uint16
    found = np.random.default_rng(seed).integers(0, 2**bits, (rows, columns)).astype(kind)
    found.flat[0] = 2**bits - 1
    return found


def with_presses(dossier: TargetRecord, **known: Any) -> TargetRecord:
    """The same with other fields of its presses."""
    return replace(dossier, presses=tuple(replace(press, **known) for press in dossier.presses))


def with_estimate(
    dossier: TargetRecord, estimate: Estimate, kind: str = "inclusion", **environment: Any
) -> TargetRecord:
    """The same with another estimate in force."""
    stored = StoredEstimate(
        kind=kind,
        estimate=estimate,
        made=WHEN + timedelta(minutes=3),
        probe="tsis-2011",
        presses=tuple(press.id for press in dossier.presses),
        calibration="0" * 64,
        environment=environment,
        id="estimate-b",
        target=dossier.target.id,
    )
    return replace(dossier, estimates=(stored,))


def hardness() -> Estimate:
    """A modulus alone, as the measurement of hardness gives it."""
    return Estimate(
        samples={"young_kpa": np.random.default_rng(5).normal(80, 4, 400)},
        prior_sd={"young_kpa": 50.0},
        identifiability="The modulus lies between 73 and 87 kPa with a probability of 90 %.",
        prior="log-uniform modulus 5 to 500 kPa",
    )


def named(kind: str = "subject") -> TargetRecord:
    """A target whose every text says who it is of, some of them in words that look like those of this program."""
    record = sample_record(kind=kind)
    known = ProbeCalibration(
        name=CALIBRATION,
        probe=PROBE,
        camera=CAMERA,
        settings={CAMERA: 1.0},
        response=Calibration(gain_grey_per_kpa=2.0, saturation_kpa=100.0, name=CALIBRATION, probe=PROBE),
    )
    presses = tuple(
        replace(
            press,
            name=f"{i}-{FRAME}",
            note=NOTE,
            settings={"file": SETTING, "camera": CAMERA, SETTING: 1.0},
            flags=(FLAG, "moving"),
            probe=PROBE,
            calibration=calibration_sha256(known),
            target=TARGET_ID,
        )
        for i, press in enumerate(record.presses)
    )
    result, rng = sample_estimate(), np.random.default_rng(3)
    estimate = replace(
        result,
        untrusted=PosteriorSamples(
            samples={**result.samples, PARAMETER: rng.normal(5, 1, 400)}, prior_sd={**result.prior_sd, PARAMETER: 2.0}
        ),
        identifiability=f"The frame {presses[0].name} tells all.",
        prior=f"as {NOTE} believed",
        notes=(NOTE,),
        flags=(*result.flags, f"{PARAMETER}_not_identified", FLAG, "off_axis"),
        provenance={
            "tsis": SETTING,
            SETTING: SETTING,
            "probe": {"name": PROBE},
            "calibration": {"name": CALIBRATION, "probe": PROBE},
            "prior": {"depth_mm": [4.0, 12.0], SETTING: 1.0, "young_kpa": SETTING},
            "images": [{"name": presses[0].name, "sha256": "0" * 64, "settings": {"path": SETTING}}, {"name": FRAME}],
            "presses": [{"name": FRAME, "seen": {SETTING: 1.0}}],
        },
    )
    stored = replace(
        record.estimates[0],
        estimate=estimate,
        probe=PROBE,
        calibration=calibration_sha256(known),
        options={SETTING: SETTING, "prior": {SETTING: 1.0}},
        environment={"tsis": SETTING, "machine": SETTING, "libraries": {SETTING: "1.0", "numpy": SETTING}},
        supersedes="estimate-of-quixote",
        id="estimate-b",
    )
    return replace(
        record,
        target=replace(record.target, id=TARGET_ID, name=NAME, note=NOTE),
        presses=presses,
        estimates=(stored,),
        calibrations={calibration_sha256(known): known},
    )


def variants() -> Iterator[tuple[str, TargetRecord]]:
    """Name and dossier of each kind of export."""
    for kind in ("phantom", "subject"):
        for bits in (8, 10, 12, 16):
            yield f"{kind}, {bits} bit", sample_record(kind=kind, full_scale=2.0**bits - 1)
    plain = sample_record()
    one = replace(plain, presses=plain.presses[:1])
    yield "one frame, 8 bit", one
    deep = framed([noise(31, 33, bits=12)], full_scale=4095.0, mm_per_pixel=(0.1, 0.2), force_n=1.0)
    yield "one frame, 12 bit", deep
    yield "no scale", with_presses(plain, mm_per_pixel=None)
    yield "no force", with_presses(plain, force_n=None)
    yield "no estimate", sample_record(estimated=False)
    yield (
        "nothing known",
        with_presses(sample_record(estimated=False), force_n=None, mm_per_pixel=None, flags=(), probe=""),
    )
    yield "not trusted", with_estimate(plain, sample_estimate(trusted=False))
    yield "hardness", with_estimate(plain, hardness(), "hardness", tsis="0.1.0", code_sha256="ab" * 32)
    yield "hardness not trusted", with_estimate(plain, replace(hardness(), trusted=False), "hardness")
    yield "no presence", with_estimate(plain, replace(sample_estimate(), presence=None))
    yield "one pixel", framed([noise(1, 1)])
    yield (
        "odd sizes",
        framed([noise(3, 5), noise(3, 5, seed=1), noise(3, 5, seed=2), noise(7, 1), noise(2, 2, bits=16)]),
    )
    yield "16 bit, odd", framed([noise(5, 7, bits=16), noise(5, 7, bits=16, seed=1)], full_scale=65535.0)
    yield "scale of many digits", framed([noise(4, 4)], mm_per_pixel=(1 / 3, 2.0 / 7e3))
    yield (
        "all roles",
        replace(
            plain,
            presses=tuple(
                replace(press, role=role)
                for press, role in zip(plain.presses, ("target", "plain", "untouched", "ball"), strict=True)
            ),
        ),
    )
    yield "label that is not ASCII", named()
    yield "longest label", replace(plain, target=replace(plain.target, name="触" * 200))
    yield "longest label, ASCII", replace(plain, target=replace(plain.target, name="long " * 40))
    yield "no label", replace(plain, target=replace(plain.target, name=""))
    yield "label of separators", replace(plain, target=replace(plain.target, name="^^==\\\\"))
    yield (
        "long texts",
        with_estimate(
            with_presses(plain, name="n" * 200, probe="p" * 200, flags=("f" * 200,)),
            replace(sample_estimate(), identifiability="word " * 2000, flags=("young_kpa_not_identified", "g" * 190)),
        ),
    )
    yield "many frames", framed([noise(9, 11, seed=i) for i in range(40)], force_n=1.25, flags=("moving",))


class Memory:
    def __init__(self, files: dict[str, bytes]) -> None:
        self.files = files

    def sizes(self) -> dict[str, int]:
        return {name: len(content) for name, content in self.files.items()}

    def read(self, name: str, most: int) -> bytes:
        return self.files[name][: most + 1]


def files_of(dossier: TargetRecord) -> dict[str, bytes]:
    found: dict[str, bytes] = {}
    _write(dossier, found.__setitem__)
    return found


def sealed(files: dict[str, bytes]) -> dict[str, bytes]:
    """The files with a manifest that fits them, as a forger would make it."""
    manifest = json.loads(files["manifest.json"])
    manifest.pop("sha256")
    manifest["files"] = {
        name: {"sha256": hashlib.sha256(content).hexdigest(), "bytes": len(content)}
        for name, content in sorted(files.items())
        if name != "manifest.json"
    }
    return files | {"manifest.json": sealed_bytes(manifest)}


def plain(dossier: TargetRecord) -> Any:
    """All of a dossier but its frames."""
    return [
        to_json_value(dossier.target),
        [to_json_value(press) for press in dossier.presses],
        [estimate_to_json(stored) for stored in dossier.estimates],
        [{name: values.tolist() for name, values in each.estimate.samples.items()} for each in dossier.estimates],
        sorted(dossier.calibrations),
    ]
