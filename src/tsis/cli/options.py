"""Options that name a phantom or probe, and replace its values."""

from __future__ import annotations

import re
from dataclasses import fields, replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

import tsis
from tsis.errors import InputError, NotCalibratedError

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Mapping, Sequence

    from tsis.calibration.frames import UsableCalibration
    from tsis.model.image import TactileImage
    from tsis.model.probe import Probe


PhantomName = Annotated[str, typer.Option("--phantom", help="Name in the catalog; tsis simulate --list shows all.")]
ProbeOption = Annotated[
    str,
    typer.Option("--probe", help="Name in the catalog (tsis simulate --list), or a file of your own, as mine.toml."),
]
ProbeName = Annotated[str, typer.Option("--probe", help="Name in the catalog; tsis simulate --list shows all.")]
ForceN = Annotated[float, typer.Option("--force-n", help="Force of the press in newtons.")]
ForcesN = Annotated[
    list[float] | None,
    typer.Option(
        "--force-n",
        help="Force of a press in newtons; repeat it for several presses.",
        show_default="those of tsis protocol: 0.5 and 1 on 5 kPa",
    ),
]
ProtocolName = Annotated[
    str,
    typer.Option("--protocol", help="usual, or careful: repeats that fit into five minutes, for narrower intervals."),
]
DiameterMm = Annotated[float | None, typer.Option("--diameter-mm", help="Diameter of the inclusion instead.")]
DepthMm = Annotated[float | None, typer.Option("--depth-mm", help="Depth of its top below the skin instead.")]
YoungKpa = Annotated[float | None, typer.Option("--young-kpa", help="Young's modulus of the inclusion instead.")]
HalfAngleDeg = Annotated[
    float | None, typer.Option("--half-angle-deg", help="Half-intensity angle of all lamps instead, degrees.")
]
LampHeightMm = Annotated[
    float | None, typer.Option("--height-mm", help="Height of all lamps above the face instead, mm.")
]
AimDeg = Annotated[
    float | None, typer.Option("--aim-deg", help="Aim of all lamps above the horizontal instead, degrees.")
]
ScaleMm = Annotated[
    str | None,
    typer.Option("--scale-mm", help="Millimetres per pixel on the face: one number, or x,y when they differ."),
]
PressForces = Annotated[
    list[float] | None,
    typer.Option("--force-n", help="Force in newtons: one for all images, or one for each, in their order."),
]
ReferencePresses = Annotated[
    list[Path] | None,
    typer.Option("--reference-press", help="Press on tissue without inclusion, same probe; best one per force."),
]
ReferenceForces = Annotated[
    list[float] | None,
    typer.Option(
        "--reference-force-n",
        help="Force of the reference presses, in their order; by default that of the images.",
    ),
]
AsJson = Annotated[bool, typer.Option("--json", help="Print the result as JSON and nothing else.")]


def _print_prior(kind: str) -> Callable[[bool], None]:
    def shown(requested: bool) -> None:
        if requested:
            typer.echo(tsis.catalog.priors.default_prior_toml(kind), nl=False)
            raise typer.Exit

    return shown


def _show_prior(kind: str) -> Any:
    help_text = "Print the default prior as a file to start from, and stop."
    return typer.Option("--show-prior", help=help_text, is_eager=True, callback=_print_prior(kind))


PriorFile = Annotated[
    Path | None,
    typer.Option(
        "--prior",
        metavar="FILE",
        help="TOML file of what is believed before any press; --show-prior prints one to start from.",
        show_default="the default prior",
    ),
]


def inclusion_prior_option(show_default: str) -> Any:
    """Return the option --prior of an inclusion, whose help names the prior that holds without it."""
    return typer.Option(
        "--prior",
        metavar="NAME|FILE",
        help="What is believed before any press: phantom-2011, breast-ex-vivo, wide, or a file (see --show-prior).",
        show_default=show_default,
    )


InclusionPriorChoice = Annotated[str | None, inclusion_prior_option("phantom-2011")]


OtherPriors = Annotated[
    bool, typer.Option("--other-priors", help="Say how far the answer moves under the other shipped priors.")
]


def other_priors(prior: tsis.inclusion.InclusionPrior) -> dict[str, tsis.inclusion.InclusionPrior]:
    """The shipped priors but the one in use."""
    named = {name: chosen_prior(name) for name in tsis.catalog.priors.list_inclusion_priors()}
    return {name: other for name, other in named.items() if replace(other, name="") != replace(prior, name="")}


def chosen_prior(given: str | None, tissue_kpa: float | None = None) -> tsis.inclusion.InclusionPrior:
    """The prior of a name or of a file, the default one without; for tissue of another modulus where that is given."""
    if tissue_kpa is not None:
        return tsis.inclusion.tissue.prior_on_tissue(chosen_prior(given), tissue_kpa)
    return tsis.inclusion.InclusionPrior() if given is None else tsis.inclusion.load_prior(given)


ShowPrior = Annotated[bool, _show_prior("inclusion")]
ShowHardnessPrior = Annotated[bool, _show_prior("hardness")]


def chosen_scale(calibration: UsableCalibration | None, given: str | None) -> tuple[float, float] | None:
    """Millimetres per pixel: the calibration's, or ``--scale-mm`` where it holds none."""
    stored = None if calibration is None else calibration.calibration.scale
    if stored is not None and given is not None:
        raise InputError("--scale-mm is not used with this calibration, which holds the scale; leave it out")
    if stored is not None:
        return stored.mm_per_pixel
    return None if given is None else scale_of(given)


def scale_of(text: str) -> tuple[float, float]:
    """Read ``0.05`` or ``0.05,0.06`` as mm per pixel."""
    try:
        parts = [float(part) for part in text.split(",")]
    except ValueError:
        parts = []
    if len(parts) not in (1, 2):
        raise InputError(f"--scale-mm must be one number or x,y in millimetres per pixel; got {text!r}")
    return tsis.model.image.require_pixel_scale((parts[0], parts[-1]))


def target_forces(given: Sequence[float], images: int) -> list[float]:
    """Force of each image: one for all, or one an image."""
    return _one_per_press("--force-n", given, images, "images")


def reference_forces(given: Sequence[float], force_n: Sequence[float], presses: int) -> list[float]:
    """Force of each reference press: as given, else that of all images, or of the image with its index."""
    if given:
        return _one_per_press("--reference-force-n", given, presses, "reference presses")
    if len(set(force_n)) == 1:
        return [force_n[0]] * presses
    if presses > len(force_n):
        raise InputError(
            "--reference-force-n must give the force of each --reference-press when they outnumber the images; "
            f"got {presses} for {len(force_n)} images"
        )
    return list(force_n[:presses])


def _one_per_press(option: str, given: Sequence[float], count: int, what: str) -> list[float]:
    if len(given) not in (1, count):
        raise InputError(f"{option} must be given once, or once for each of {count} {what}; got it {len(given)} times")
    return list(given) * (count if len(given) == 1 else 1)


ENDING = ".toml"
LARGEST_FILE_BYTES = 64 * 2**10
MOST_LAYERS, MOST_LAMPS = 20, 100
NAME = re.compile(r"\w[\w .,()+-]{0,59}")  # which every table, page and file shows as it is
KEYS = ("radius_mm", "layers", "face_curvature_mm", "sides", "glass", "leds", "assumed")


def is_file(probe: str) -> bool:
    """Whether ``--probe`` names a file and not an entry of the catalog."""
    return probe.lower().endswith(ENDING)


def is_careful(protocol: str) -> bool:
    """Whether ``--protocol`` names the careful one."""
    return tsis.model.require.require_one_of("protocol", protocol, ("usual", "careful")) == "careful"


def chosen_probe(probe: str) -> Probe:
    """The probe that ``--probe`` names: one of the catalog, or that of a TOML file.

    Raises
    ------
    UnknownNameError
        When the catalog has no such probe.
    FileInputError
        When the file is missing, no TOML, holds not one probe, or a value that a probe cannot take.
    """
    return read_probe(Path(probe)) if is_file(probe) else tsis.catalog.load_probe(probe)


def calibrated_probe(name: str, *, unnamed: str) -> Probe:
    """The probe of the catalog that a calibration names, ``unnamed`` where it names none.

    Raises
    ------
    NotCalibratedError
        When the calibration is of a probe that the catalog does not have.
    """
    if name and name not in tsis.catalog.probes.list_probes():
        raise NotCalibratedError(
            f"the calibration is of the probe {name!r:.80}, which is not in the catalog: give its file, as --probe "
            "mine.toml"
        )
    return tsis.catalog.load_probe(name or unnamed)


def chosen_lit_probe(probe: str, half_angle_deg: float | None, height_mm: float | None, aim_deg: float | None) -> Probe:
    """The probe that ``--probe`` names, with the given values of all lamps replaced where it is one of the catalog."""
    if not is_file(probe):
        return tsis.catalog.probes.probe_variant(probe, half_angle_deg, height_mm, aim_deg)
    if (half_angle_deg, height_mm, aim_deg) != (None, None, None):
        raise InputError(
            f"--half-angle-deg, --height-mm and --aim-deg change the lamps of a probe of the catalog; got {probe}: "
            "change leds in that file"
        )
    return read_probe(Path(probe))


def require_no_file(what: str, probe: str | None) -> None:
    """Refuse a probe of a file where its name must mean the same later."""
    if probe is not None and is_file(probe):
        raise InputError(
            f"{what} needs a probe of the catalog, from which the estimate can be made again; got {probe}: leave "
            f"{what} out"
        )


def read_probe(file: Path) -> Probe:
    """The one probe of a TOML file, written as an entry of the catalog; errors as `chosen_probe`."""
    return tsis.files.reading.read_parsed(file, _parsed, most=LARGEST_FILE_BYTES)


def _parsed(text: str) -> Probe:
    document = tsis.files.reading.parse_toml(text, what="a probe")
    entries = {name: value for name, value in document.items() if isinstance(value, dict)}
    if len(document) != 1 or len(entries) != 1:
        got = f"{tsis.files.reading.one_line(', '.join(document)):.80}" if document else "nothing"
        raise InputError(f"it must hold one probe, a table under its name as [my-probe]; got {got}")
    ((name, entry),) = entries.items()
    if not NAME.fullmatch(name):
        raise InputError(
            f"the name must be up to 60 letters, digits, spaces and any of - _ . , ( ) +; got {name!r:.80}"
        )
    if name in tsis.catalog.probes.list_probes():
        raise InputError(f"the name {name!r} is that of a probe of the catalog; choose another, as [my-{name}]")
    return tsis.catalog.probes.parse_probe(name, _checked(entry))


def _checked(entry: Mapping[str, Any]) -> dict[str, Any]:
    """The entry with nothing in it that a probe of the catalog does not have; values are checked by the probe."""
    _require_known("a probe", entry, KEYS)
    if "radius_mm" not in entry or "layers" not in entry:
        raise InputError(f"a probe must give radius_mm and layers; got {', '.join(entry) or 'nothing'}")
    for layer in _tables("layers", entry["layers"], MOST_LAYERS):
        _require_known("a layer", layer, (field.name for field in fields(tsis.model.probe.Layer)))
        if not {"thickness_mm", "young_kpa"} <= set(layer):
            raise InputError(f"a layer must give thickness_mm and young_kpa; got {', '.join(layer) or 'nothing'}")
    for lamp in _tables("leds", entry.get("leds", []), MOST_LAMPS):
        _require_known("a lamp", lamp, (field.name for field in fields(tsis.model.probe.Led)))
    (glass,) = _tables("glass", [entry.get("glass", {})], 1)
    _require_known("the glass", glass, (field.name for field in fields(tsis.model.probe.Glass)))
    assumed = entry.get("assumed", [])
    if not isinstance(assumed, list) or not all(isinstance(name, str) for name in assumed):
        raise InputError(f"assumed must be a list of names of values; got {assumed!r:.80}")
    return dict(entry)


def _require_known(what: str, table: Mapping[str, Any], names: Iterable[str]) -> None:
    names = tuple(names)
    for key in table:
        tsis.model.require.require_one_of(f"value of {what}", key, names)


def _tables(name: str, value: Any, most: int) -> list[dict[str, Any]]:
    if not isinstance(value, list) or not all(isinstance(item, dict) for item in value):
        raise InputError(f"{name} must be tables, as {{ thickness_mm = 2.0 }}; got {value!r:.80}")
    if len(value) > most:
        raise InputError(f"{name} must be at most {most}; got {len(value)}")
    return value


def read_frames(
    paths: Sequence[Path], forces: Sequence[float | None], scale: tuple[float, float] | None
) -> list[TactileImage]:
    """Frames of files, each with its force in newtons and all with one scale (x, y) in mm per pixel."""
    return [
        tsis.calibration.frames.read_press_image(path, mm_per_pixel=scale, force_n=force)
        for path, force in zip(paths, forces, strict=True)
    ]


def numbers(name: str, text: str) -> list[float]:
    """Read what was given to the option ``name``: numbers with commas between."""
    try:
        return [float(part) for part in text.split(",")]
    except ValueError as error:
        raise InputError(f"{name} must be numbers with commas between, as 1.41,1.515; got {text!r}") from error


def typed_options(context: typer.Context, names: Iterable[str]) -> list[str]:
    """Those of the named parameters that the user typed, as they are typed: a command refuses what it would ignore."""
    forms = {parameter.name: max(parameter.opts, key=len) for parameter in context.command.params}
    sources = {name: context.get_parameter_source(name) for name in names}
    return [forms[name] for name, source in sources.items() if source is not None and source.name == "COMMANDLINE"]
