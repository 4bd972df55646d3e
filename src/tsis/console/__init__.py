"""The instrument in a browser, on this machine or on a network."""

from tsis.errors import require_extra

require_extra("nicegui", "fastapi", "uvicorn", "argon2", "itsdangerous", feature="the console", extra="console")
