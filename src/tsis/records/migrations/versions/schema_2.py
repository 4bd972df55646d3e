"""Schema 2: what the guard said of a press, notes on presses, and indexes for stores of many presses."""

from alembic import op

revision = "2"
down_revision = "1"


def upgrade() -> None:
    """Add what old rows leave empty, so that their digests in the audit stay what they were."""
    op.execute("ALTER TABLE presses ADD COLUMN flags TEXT")
    op.execute("ALTER TABLE presses ADD COLUMN note TEXT")
    op.execute("CREATE INDEX presses_of_a_target ON presses (target, taken, id)")
    op.execute("CREATE INDEX estimates_of_a_target ON estimates (target, made, id)")
    op.execute('CREATE INDEX audit_of_a_row ON audit (kind, "row", number)')
