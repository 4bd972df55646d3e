"""Texts of the console by language: gettext's call on one catalogue for each, whose keys are the English texts."""

from __future__ import annotations

import json
from functools import cache
from gettext import NullTranslations
from pathlib import Path
from typing import Final

CATALOGUES = Path(__file__).parent / "languages"
ENGLISH: Final = "en"
COOKIE = "tsis-language"  # of the browser, with the code of its language


class Catalogue(NullTranslations):
    """The texts of one language, by their English.

    Examples
    --------
    >>> Catalogue({"Camera": "Kamera"}).gettext("Camera"), Catalogue({}).gettext("Camera")
    ('Kamera', 'Camera')
    """

    def __init__(self, texts: dict[str, str]) -> None:
        super().__init__()
        self._texts = texts

    def gettext(self, message: str) -> str:
        """The text in this language; the English one where it is missing."""
        return self._texts.get(message, message)


@cache
def catalogue(language: str) -> Catalogue:
    """The catalogue of a language; an empty one for English."""
    if language == ENGLISH:
        return Catalogue({})
    return Catalogue(json.loads((CATALOGUES / f"{language}.json").read_text(encoding="utf-8")))


@cache
def languages() -> dict[str, str]:
    """The languages by their codes, each under its own name, which its catalogue has under ``English``."""
    codes = sorted(file.stem for file in CATALOGUES.glob("*.json"))
    return {ENGLISH: "English"} | {code: catalogue(code).gettext("English") for code in codes}


def translated(text: str, language: str, **values: object) -> str:
    """A text in one of the languages, with values in place of names in braces.

    Examples
    --------
    >>> translated("Target {number}", "de", number=7), translated("Camera", "en")
    ('Ziel 7', 'Camera')
    """
    found = catalogue(language).gettext(text)
    return found.format(**values) if values else found
