"""What a server shows so that others can be sure of it: a certificate and its private key, from files."""

import ssl
from dataclasses import dataclass
from pathlib import Path

from daemon.errors import ServeError


@dataclass(frozen=True, slots=True)
class Tls:
    """Two PEM files: the certificate, with those that vouch for it after it, and its private key."""

    certificate: Path
    key: Path

    def check(self) -> None:
        """Raise ServeError, with what to do, unless the two can be served with."""
        for name, file in (("certificate", self.certificate), ("key", self.key)):
            try:
                file.open("rb").close()
            except OSError as error:
                raise ServeError(f"{file}: {error.strerror}: give another --tls-{name}") from None
        try:
            # Without a password of its own, OpenSSL would ask for one on the terminal.
            ssl.SSLContext(ssl.PROTOCOL_TLS_SERVER).load_cert_chain(self.certificate, self.key, _no_password)
        except _EncryptedKeyError:
            raise ServeError(
                f"{self.key}: the key is encrypted: give one without a passphrase, which only this user can read"
            ) from None
        except ssl.SSLError as error:
            if error.reason == "KEY_VALUES_MISMATCH":
                reason = f"this is not the key of {self.certificate}"
            else:
                reason = "these are not a certificate and a private key in PEM form"
            raise ServeError(f"{self.key}: {reason}: give another --tls-certificate or --tls-key") from None


class _EncryptedKeyError(Exception):
    """A passphrase was asked for."""


def _no_password() -> str:
    raise _EncryptedKeyError
