"""Schema 1: targets, calibrations, frames, presses, estimates, and the chained audit that nothing may change."""

from alembic import op

revision = "1"
down_revision = None

_TABLES = (
    "CREATE TABLE store (name TEXT NOT NULL PRIMARY KEY, value TEXT NOT NULL)",
    """CREATE TABLE targets (id TEXT NOT NULL PRIMARY KEY, number INTEGER NOT NULL UNIQUE, kind TEXT NOT NULL,
    name TEXT NOT NULL, note TEXT NOT NULL, truth TEXT NOT NULL, made TEXT NOT NULL, version INTEGER NOT NULL)""",
    """CREATE TABLE calibrations (id TEXT NOT NULL PRIMARY KEY, file TEXT NOT NULL, name TEXT NOT NULL,
    probe TEXT NOT NULL, made TEXT NOT NULL)""",
    """CREATE TABLE frames (id TEXT NOT NULL PRIMARY KEY, "rows" INTEGER NOT NULL, "columns" INTEGER NOT NULL,
    bytes INTEGER NOT NULL)""",
    """CREATE TABLE presses (id TEXT NOT NULL PRIMARY KEY, target TEXT NOT NULL REFERENCES targets (id),
    role TEXT NOT NULL, taken TEXT NOT NULL, frame TEXT NOT NULL REFERENCES frames (id),
    full_scale DOUBLE PRECISION NOT NULL, force_n DOUBLE PRECISION, mm_per_pixel_x DOUBLE PRECISION,
    mm_per_pixel_y DOUBLE PRECISION, axis_px_x DOUBLE PRECISION NOT NULL, axis_px_y DOUBLE PRECISION NOT NULL,
    probe TEXT NOT NULL, calibration TEXT REFERENCES calibrations (id), settings TEXT NOT NULL, name TEXT NOT NULL,
    version INTEGER NOT NULL)""",
    """CREATE TABLE estimates (id TEXT NOT NULL PRIMARY KEY, target TEXT NOT NULL REFERENCES targets (id),
    kind TEXT NOT NULL, made TEXT NOT NULL, probe TEXT NOT NULL, presses TEXT NOT NULL,
    calibration TEXT NOT NULL REFERENCES calibrations (id), options TEXT NOT NULL, environment TEXT NOT NULL,
    supersedes TEXT REFERENCES estimates (id), document TEXT NOT NULL, samples TEXT NOT NULL)""",
    """CREATE TABLE audit (number INTEGER NOT NULL PRIMARY KEY, moment TEXT NOT NULL, actor TEXT NOT NULL,
    action TEXT NOT NULL, kind TEXT NOT NULL, "row" TEXT NOT NULL, content TEXT NOT NULL, previous TEXT NOT NULL,
    hash TEXT NOT NULL)""",
    "CREATE TABLE audit_head (id INTEGER NOT NULL PRIMARY KEY, number INTEGER NOT NULL, hash TEXT NOT NULL)",
)
_APPEND_ONLY = {
    "sqlite": (
        "CREATE TRIGGER audit_no_update BEFORE UPDATE ON audit BEGIN SELECT RAISE(ABORT, 'audit is append-only'); END",
        "CREATE TRIGGER audit_no_delete BEFORE DELETE ON audit BEGIN SELECT RAISE(ABORT, 'audit is append-only'); END",
    ),
    "postgresql": (
        """CREATE FUNCTION audit_append_only() RETURNS trigger AS
        $$ BEGIN RAISE EXCEPTION 'audit is append-only'; END $$ LANGUAGE plpgsql""",
        """CREATE TRIGGER audit_append_only BEFORE UPDATE OR DELETE OR TRUNCATE ON audit
        FOR EACH STATEMENT EXECUTE FUNCTION audit_append_only()""",
    ),
}


def upgrade() -> None:
    """Make everything."""
    for statement in (*_TABLES, *_APPEND_ONLY[op.get_bind().dialect.name]):
        op.execute(statement)
