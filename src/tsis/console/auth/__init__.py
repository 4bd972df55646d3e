"""Who may talk to the console: a token or a login, known hosts, own pages."""

from tsis.console.auth._access import Access, name_of, visitor_of
from tsis.console.auth._key import console_folder, kept_token, write_private
from tsis.console.auth._login_routes import LOGOUT, failed
from tsis.console.auth._logins import Logins
from tsis.console.auth._middleware import Gate
from tsis.console.auth._sessions import Sessions

__all__ = [
    "LOGOUT",
    "Access",
    "Gate",
    "Logins",
    "Sessions",
    "console_folder",
    "failed",
    "kept_token",
    "name_of",
    "visitor_of",
    "write_private",
]
