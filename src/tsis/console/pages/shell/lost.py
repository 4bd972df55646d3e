"""What a page says when it has lost its console."""

from __future__ import annotations

from typing import Final

from nicegui.translations import translations

LANGUAGE: Final = "en-GB"
WORDS = {
    "connection_lost": "The connection to the console is lost.",
    "trying_to_reconnect": "Trying again. What was kept is safe; a sequence or job under way goes on meanwhile.",
    "message_too_long": "This was too much for one message.",
    "message_too_long_body": "It was not done. Try again with less of it.",
}


def say_lost() -> None:
    """Have the library of the pages say it in these words, in every page from now on."""
    translations[LANGUAGE] = {**translations["en-US"], **WORDS}
