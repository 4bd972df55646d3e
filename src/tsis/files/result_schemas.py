"""Names and versions of the JSON results."""

from __future__ import annotations

from types import MappingProxyType
from typing import TYPE_CHECKING, Any

from tsis.errors import FileInputError

if TYPE_CHECKING:
    from collections.abc import Mapping


# Results of each command; "" is that without a part.
_RESULTS = {
    "acquire": ("describe", "gel", "list", "record", "snapshot", "watch"),
    "calibrate": ("", "light", "seal", "show"),
    "console": ("",),
    "compare": ("",),
    "contacts": ("", "probe"),
    "demo": ("", "seeds"),
    "depth": ("calibrate", "map"),
    "design": ("",),
    "detect": ("apply", "train"),
    "doctor": ("",),
    "examine": ("",),
    "force": ("", "frames"),
    "hardness": ("", "contacts"),
    "indent": ("",),
    "logins": ("",),
    "map": ("",),
    "match": ("",),
    "network": ("apply", "train"),
    "optics": ("angles", "modes", "propagate", "trace"),
    "protocol": ("",),
    "records": ("backup", "edit", "export", "import", "list", "recompute", "restore", "show", "verify"),
    "sensor": ("check", "frames", "new", "show"),
    "session": ("",),
    "simulate": ("", "gel", "list", "scan"),
    "study": (
        "analyse",
        "card",
        "check",
        "export",
        "import",
        "kit",
        "new",
        "plan",
        "repeatability",
        "run",
        "score",
        "show",
        "size",
        "verify",
    ),
    "sweep": ("run", "run-plan", "verify"),
    "track": ("",),
}
# Version by name; it increases when a name in the document is removed or changes its meaning.
RESULT_SCHEMAS: Mapping[str, int] = MappingProxyType(
    {f"tsis-{command}-{part}".rstrip("-"): 1 for command, parts in _RESULTS.items() for part in parts}
)


def require_known_schema(document: Mapping[str, Any], source: str) -> None:
    """Refuse a JSON result without a schema of tsis, or of a newer version than this program reads.

    Parameters
    ----------
    document
        The result.
    source
        Its name in the message.

    Raises
    ------
    FileInputError
        When the schema is missing, unknown or newer.

    Examples
    --------
    >>> require_known_schema({"schema": {"name": "tsis-demo", "version": 9}}, "result.json")
    Traceback (most recent call last):
    ...
    tsis.errors.FileInputError: result.json must be of tsis-demo up to version 1; got version 9: update tsis to read it
    """
    schema = document.get("schema")
    if not isinstance(schema, dict):
        raise FileInputError(f"{source} must name a schema of a result of tsis; it names none")
    name, version = str(schema.get("name")), schema.get("version")
    if name not in RESULT_SCHEMAS or type(version) is not int or version < 1:
        raise FileInputError(
            f"{source} must name a schema of a result of tsis; got {name!r:.60}, version {version!r:.20}"
        )
    if version > RESULT_SCHEMAS[name]:
        raise FileInputError(
            f"{source} must be of {name} up to version {RESULT_SCHEMAS[name]}; got version {version}: update tsis to "
            "read it"
        )
