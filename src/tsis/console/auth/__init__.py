"""Who may use the console: key, logins, sessions, rate limits and headers."""

from tsis.console.auth._access import Access, Logins, client_identity, name_of
from tsis.console.auth._key import console_folder, saved_token, write_private
from tsis.console.auth._login_routes import LOGOUT, failed
from tsis.console.auth._middleware import AuthMiddleware
from tsis.console.auth._sessions import Sessions

__all__ = [
    "LOGOUT",
    "Access",
    "AuthMiddleware",
    "Logins",
    "Sessions",
    "client_identity",
    "console_folder",
    "failed",
    "name_of",
    "saved_token",
    "write_private",
]
