"""The certificate of a console that listens on a network."""

from __future__ import annotations

import ssl
from dataclasses import dataclass
from typing import TYPE_CHECKING

from tsis.model.errors import FileInputError

if TYPE_CHECKING:
    from pathlib import Path


@dataclass(frozen=True, slots=True, kw_only=True)
class Certificate:
    """A certificate, with those that vouch for it, and its private key.

    Attributes
    ----------
    chain, key
        Files in PEM; the key must not be locked by a password.
    """

    chain: Path
    key: Path

    def context(self) -> ssl.SSLContext:
        """What a server speaks TLS with, from version 1.2 on.

        Raises
        ------
        FileInputError
            When the files cannot be read or do not belong together.
        """
        context = ssl.SSLContext(ssl.PROTOCOL_TLS_SERVER)
        context.minimum_version = ssl.TLSVersion.TLSv1_2
        for name, path in (("certificate", self.chain), ("key", self.key)):
            if not path.is_file():
                raise FileInputError(f"{name} must be a file in PEM; got {path}, which is none")
        try:
            context.load_cert_chain(self.chain, self.key, _no_password)
        except ssl.SSLError as error:
            raise FileInputError(
                f"{self.chain} and {self.key} must hold a certificate and its key in PEM; got: {error.reason or error}"
            ) from error
        except OSError as error:
            raise FileInputError(
                f"{self.chain} and {self.key} must be readable; got: {error.strerror or error}"
            ) from error
        return context


def _no_password() -> str:
    raise FileInputError("key must not be locked by a password (openssl pkey -in LOCKED -out KEY unlocks it)")
