"""Authorities, and certificates that they sign, in PEM files."""

import datetime
from pathlib import Path

from cryptography import x509
from cryptography.hazmat.primitives import hashes, serialization
from cryptography.hazmat.primitives.asymmetric import ec
from cryptography.x509.oid import NameOID


def _name(text: str) -> x509.Name:
    return x509.Name([x509.NameAttribute(NameOID.COMMON_NAME, text)])


def _write(path: Path, content: bytes) -> Path:
    path.write_bytes(content)
    return path


def make(folder: Path, password: bytes | None = None) -> tuple[Path, Path, Path]:
    """A new authority, and a certificate of it with its private key: files ca, cert and key."""
    folder.mkdir()
    now = datetime.datetime.now(datetime.UTC)
    own, other = (ec.generate_private_key(ec.SECP256R1()) for _ in range(2))

    def signed(key: ec.EllipticCurvePrivateKey, text: str, is_authority: bool) -> bytes:
        made = (
            x509.CertificateBuilder()
            .subject_name(_name(text))
            .issuer_name(_name("authority"))
            .public_key(key.public_key())
            .serial_number(x509.random_serial_number())
            .not_valid_before(now - datetime.timedelta(days=1))
            .not_valid_after(now + datetime.timedelta(days=1))
            .add_extension(x509.BasicConstraints(is_authority, None), critical=True)
            .sign(own, hashes.SHA256())
        )
        return made.public_bytes(serialization.Encoding.PEM)

    protection = (
        serialization.BestAvailableEncryption(password)
        if password
        else serialization.NoEncryption()
    )
    private = other.private_bytes(
        serialization.Encoding.PEM, serialization.PrivateFormat.PKCS8, protection
    )
    return (
        _write(folder / "ca.pem", signed(own, "authority", True)),
        _write(folder / "cert.pem", signed(other, "campaign", False)),
        _write(folder / "key.pem", private),
    )
