"""The tables of the present schema; `migrations` has the steps from older ones.

Times are ISO 8601 in UTC, nested values canonical JSON, both as text: the same in every database.
"""

from __future__ import annotations

from sqlalchemy import Column, Float, ForeignKey, Index, Integer, MetaData, Table, Text

metadata = MetaData()

store_table = Table("store", metadata, Column("name", Text, primary_key=True), Column("value", Text, nullable=False))

target_table = Table(
    "targets",
    metadata,
    Column("id", Text, primary_key=True),
    Column("number", Integer, nullable=False, unique=True),
    Column("kind", Text, nullable=False),
    Column("name", Text, nullable=False),
    Column("note", Text, nullable=False),
    Column("truth", Text, nullable=False),
    Column("made", Text, nullable=False),
    Column("version", Integer, nullable=False),
)

calibration_table = Table(
    "calibrations",
    metadata,
    Column("id", Text, primary_key=True),  # SHA-256 of its content, by which results cite it
    Column("file", Text, nullable=False),  # SHA-256 of its file
    Column("name", Text, nullable=False),
    Column("probe", Text, nullable=False),
    Column("made", Text, nullable=False),
)

frame_table = Table(
    "frames",
    metadata,
    Column("id", Text, primary_key=True),  # SHA-256 of its file
    Column("rows", Integer, nullable=False),
    Column("columns", Integer, nullable=False),
    Column("bytes", Integer, nullable=False),
)

press_table = Table(
    "presses",
    metadata,
    Column("id", Text, primary_key=True),
    Column("target", Text, ForeignKey("targets.id"), nullable=False),
    Column("role", Text, nullable=False),
    Column("taken", Text, nullable=False),
    Column("frame", Text, ForeignKey("frames.id"), nullable=False),
    Column("full_scale", Float(53), nullable=False),
    Column("force_n", Float(53)),
    Column("mm_per_pixel_x", Float(53)),
    Column("mm_per_pixel_y", Float(53)),
    Column("axis_px_x", Float(53), nullable=False),
    Column("axis_px_y", Float(53), nullable=False),
    Column("probe", Text, nullable=False),
    Column("calibration", Text, ForeignKey("calibrations.id")),
    Column("settings", Text, nullable=False),
    Column("name", Text, nullable=False),
    Column("version", Integer, nullable=False),
    Column("flags", Text),  # since schema 2
    Column("note", Text),  # since schema 2
    Index("presses_of_a_target", "target", "taken", "id"),  # since schema 2
)

estimate_table = Table(
    "estimates",
    metadata,
    Column("id", Text, primary_key=True),
    Column("target", Text, ForeignKey("targets.id"), nullable=False),
    Column("kind", Text, nullable=False),
    Column("made", Text, nullable=False),
    Column("probe", Text, nullable=False),
    Column("presses", Text, nullable=False),
    Column("calibration", Text, ForeignKey("calibrations.id"), nullable=False),
    Column("options", Text, nullable=False),
    Column("environment", Text, nullable=False),
    Column("supersedes", Text, ForeignKey("estimates.id")),
    Column("document", Text, nullable=False),  # the estimate without its samples
    Column("samples", Text, nullable=False),  # SHA-256 of their file
    Index("estimates_of_a_target", "target", "made", "id"),  # since schema 2
)

audit_table = Table(
    "audit",
    metadata,
    Column("number", Integer, primary_key=True, autoincrement=False),
    Column("moment", Text, nullable=False),
    Column("actor", Text, nullable=False),
    Column("action", Text, nullable=False),
    Column("kind", Text, nullable=False),  # the table of the row
    Column("row", Text, nullable=False),  # its key
    Column("content", Text, nullable=False),  # digest of the new row
    Column("previous", Text, nullable=False),
    Column("hash", Text, nullable=False),
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
