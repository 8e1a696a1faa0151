"""Certificates of the user's, for a scheduler that runs elsewhere."""

import os
import ssl
from pathlib import Path

from distributed import Security

from rparm.errors import UserError, placed, reason
from rparm.files import check_regular

TLS = "tls://"
OPTIONS = ("--tls-ca", "--tls-cert", "--tls-key")
EXPECTED = "an address as tls://192.168.0.1:8786"


def of(address: str, ca: Path | None, cert: Path | None, key: Path | None) -> Security | None:
    """What a client of the scheduler at `address` needs; None for one without certificates.

    Files in PEM form: the certificate of the authority that signs all others, and the client's own
    with its private key; without them, those of Dask's configuration. UserError if they do not fit
    the address or cannot be used.
    """
    given = dict(zip(OPTIONS, (ca, cert, key), strict=True))
    named = [option for option, path in given.items() if path is not None]
    if not address.startswith(TLS):
        if named:
            raise UserError(f"{named[0]}: {address} takes no certificates, expected {EXPECTED}")
        return None
    if not named:
        return _configured(address)
    if len(named) < len(OPTIONS):
        missing = ", ".join(option for option in OPTIONS if option not in named)
        raise UserError(f"{missing}: missing, {address} needs {', '.join(OPTIONS)}")
    _check(ca, cert, key)
    return Security(
        require_encryption=True,
        tls_ca_file=str(ca),
        tls_client_cert=str(cert),
        tls_client_key=str(key),
    )


def _configured(address: str) -> Security:
    made = Security(require_encryption=True)
    ca, cert, key = made.tls_ca_file, made.tls_client_cert, made.tls_client_key
    if not ca or not cert:
        raise UserError(
            f"{address}: needs certificates: {', '.join(OPTIONS)}, or those of Dask's configuration"
        )
    if not any("\n" in text for text in (ca, cert, key or "")):  # else not files, but their text
        _check(Path(ca), Path(cert), Path(key or cert))
    return made


def _check(ca: Path, cert: Path, key: Path) -> None:
    """Load the files as Dask does, but never ask for a password on the terminal."""
    for path in (ca, cert, key):
        try:
            with placed(path):
                check_regular(path)
            os.close(os.open(path, os.O_RDONLY))
        except OSError as error:
            raise UserError(f"{path}: cannot be read: {reason(error)}") from None
    context = ssl.SSLContext(ssl.PROTOCOL_TLS_CLIENT)
    try:
        context.load_verify_locations(ca)
    except OSError:
        raise UserError(f"{ca}: is not the certificate of an authority in PEM form") from None
    try:
        context.load_cert_chain(cert, key, password=lambda: "")
    except OSError:
        raise UserError(
            f"{cert}, {key}: are not a certificate and its private key without a password, in PEM "
            "form"
        ) from None
