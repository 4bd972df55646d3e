"""The tables of the present schema; `migrations` has the steps from older ones.

Times are ISO 8601 in UTC, nested values canonical JSON, both as text: the same in every database.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from sqlalchemy import Column, Float, ForeignKey, Index, Integer, MetaData, Table, Text

if TYPE_CHECKING:
    from collections.abc import Iterator

metadata = MetaData()


def _columns(kind: Any, *names: str) -> Iterator[Column[Any]]:
    """Columns of one type that hold a value in every row."""
    return (Column(name, kind, nullable=False) for name in names)


store_table = Table("store", metadata, Column("name", Text, primary_key=True), Column("value", Text, nullable=False))

target_table = Table(
    "targets",
    metadata,
    Column("id", Text, primary_key=True),
    Column("number", Integer, nullable=False, unique=True),
    *_columns(Text, "kind", "name", "note", "truth", "made"),
    Column("version", Integer, nullable=False),
)

calibration_table = Table(
    "calibrations",
    metadata,
    Column("id", Text, primary_key=True),  # SHA-256 of its content, by which results cite it
    *_columns(Text, "file", "name", "probe", "made"),  # the SHA-256 of its file, and its fields
)

frame_table = Table(
    "frames",
    metadata,
    Column("id", Text, primary_key=True),  # SHA-256 of its file
    *_columns(Integer, "rows", "columns", "bytes"),
)

press_table = Table(
    "presses",
    metadata,
    Column("id", Text, primary_key=True),
    Column("target", Text, ForeignKey("targets.id"), nullable=False),
    *_columns(Text, "role", "taken"),
    Column("frame", Text, ForeignKey("frames.id"), nullable=False),
    Column("full_scale", Float(53), nullable=False),
    *(Column(name, Float(53)) for name in ("force_n", "mm_per_pixel_x", "mm_per_pixel_y")),
    *_columns(Float(53), "axis_px_x", "axis_px_y"),
    Column("probe", Text, nullable=False),
    Column("calibration", Text, ForeignKey("calibrations.id")),
    *_columns(Text, "settings", "name"),
    Column("version", Integer, nullable=False),
    *(Column(name, Text) for name in ("flags", "note")),  # since schema 2
    Index("presses_of_a_target", "target", "taken", "id"),  # since schema 2
)

estimate_table = Table(
    "estimates",
    metadata,
    Column("id", Text, primary_key=True),
    Column("target", Text, ForeignKey("targets.id"), nullable=False),
    *_columns(Text, "kind", "made", "probe", "presses"),
    Column("calibration", Text, ForeignKey("calibrations.id"), nullable=False),
    *_columns(Text, "options", "environment"),
    Column("supersedes", Text, ForeignKey("estimates.id")),
    *_columns(Text, "document", "samples"),  # the estimate without its samples, and the SHA-256 of their file
    Index("estimates_of_a_target", "target", "made", "id"),  # since schema 2
)

audit_table = Table(
    "audit",
    metadata,
    Column("number", Integer, primary_key=True, autoincrement=False),
    # Table and key of a row, the digest of its new content, and the hashes of the previous entry and of this one.
    *_columns(Text, "moment", "actor", "action", "kind", "row", "content", "previous", "hash"),
    Index("audit_of_a_row", "kind", "row", "number"),  # since schema 2
)

audit_head_table = Table(
    "audit_head",
    metadata,
    Column("id", Integer, primary_key=True),
    Column("number", Integer, nullable=False),
    Column("hash", Text, nullable=False),
)

RECORDED = {
    table.name: table
    for table in (store_table, target_table, calibration_table, frame_table, press_table, estimate_table)
}
