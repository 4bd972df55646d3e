"""Schemas of the value classes: the dataclass gives fields and types, its docstring the descriptions."""

from __future__ import annotations

import inspect
import re
from functools import partial
from typing import Annotated, Any

from pydantic import GetCoreSchemaHandler
from pydantic_core import CoreSchema, core_schema

from tsis.calibration.guard import GuardFlag
from tsis.console.services import CameraChoice, CameraState, ContactView, FrameAnalysis, JobState, PressForce
from tsis.files.json_values import free_to_json
from tsis.imaging.depth import GelReading
from tsis.instrument import CameraInfo, Setting
from tsis.instrument.recording import RecordingReport
from tsis.records.recomputation import Shift
from tsis.records.values import StoredPress, Target


class Fields:
    """Marks a value class in an annotation: which fields JSON leaves out, and which properties it adds.

    Mappings become plain objects, their infinite numbers strings.
    """

    def __init__(self, *, without: tuple[str, ...] = (), also: tuple[str, ...] = ()) -> None:
        self._without, self._also = without, also

    def __get_pydantic_core_schema__(self, source: Any, handler: GetCoreSchemaHandler) -> CoreSchema:
        """The schema that pydantic makes of the class, with these changes."""
        schema = handler(source)
        values: Any = handler.resolve_ref_schema(schema)["schema"]
        for field in values["fields"]:
            field["serialization_exclude"] = field["name"] in self._without
            inner = field["schema"].get("schema", {})
            if inner.get("type") == "dict":
                inner["serialization"] = core_schema.plain_serializer_function_ser_schema(
                    partial(free_to_json, where=field["name"]), return_schema=inner.copy()
                )
        values["computed_fields"] = [core_schema.computed_field(name, core_schema.str_schema()) for name in self._also]
        return schema


CameraInfoItem = Annotated[CameraInfo, Fields(also=("spec",))]
PressItem = Annotated[StoredPress, Fields(without=("target",))]
ShiftItem = Annotated[Shift, Fields(without=("low_shift", "high_shift"))]
TargetItem = Annotated[Target, Fields()]
UNBOUNDED = {  # numbers that may be infinite, which JSON writes as null
    CameraState: ("frames_per_s",),
    GuardFlag: ("value", "limit"),
    Setting: ("value", "low", "high"),
}
VALUES = (
    *(CameraChoice, CameraInfo, CameraState, ContactView, FrameAnalysis, GelReading, GuardFlag, JobState, PressForce),
    *(RecordingReport, Setting, Shift, StoredPress, Target),
)


def describe_values(schemas: dict[str, Any]) -> None:
    """Complete the schemas of value classes: each field is there, and described as the docstring says."""
    for value in VALUES:
        schema = schemas[value.__name__]
        schema["description"], described = docstring_parts(value)
        schema["required"] = list(schema["properties"])
        for name, field in schema["properties"].items():
            field.pop("default", None)
            if name in described:
                field["description"] = described[name]
            if name in UNBOUNDED.get(value, ()):
                field["anyOf"] = [{"type": field.pop("type")}, {"type": "null"}]


def docstring_parts(value: type) -> tuple[str, dict[str, str]]:
    """The summary of a class's docstring, and the description of each of its parameters or attributes."""
    text = inspect.cleandoc(value.__doc__ or "") + "\n"
    described: dict[str, str] = {}
    for names, description in re.findall(r"^(\w+(?:, \w+)*)\n((?:    .*\n)+)", text, flags=re.MULTILINE):
        described |= dict.fromkeys(names.split(", "), re.sub(r"\bNone\b", "null", " ".join(description.split())))
    return text.partition("\n")[0], described
