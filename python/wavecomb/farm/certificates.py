# SPDX-License-Identifier: Apache-2.0
"""Certificates of a job: who has one may talk to its Dask scheduler, and nobody else.

One authority signs a certificate for the scheduler, one for its workers and one for clients. The
authority's key is thrown away, so there will be no further ones: who is to be let in later gets a
new set.
"""

from __future__ import annotations

import datetime
import os
from pathlib import Path

from wavecomb.errors import WavecombError
from wavecomb.extras import needed

NAMES = ("scheduler", "worker", "client")


def make_certificates(folder: str | os.PathLike[str], days: int = 30) -> list[Path]:
    """Writes ca.pem, and NAME.pem and NAME.key for ``NAMES``; keys are for their owner alone.

    Args:
        folder: That is not there yet, or empty.
        days: That they are good for.

    Raises:
        WavecombError: Something is there.
    """
    needed("cryptography", "farm certificates", "farm")
    from cryptography import x509
    from cryptography.hazmat.primitives import hashes, serialization
    from cryptography.hazmat.primitives.asymmetric import ec
    from cryptography.x509.oid import ExtendedKeyUsageOID, NameOID

    place = Path(folder)
    if place.exists() and (not place.is_dir() or any(place.iterdir())):
        raise WavecombError(f"{place}: is there already; give a folder that is new or empty")
    place.mkdir(mode=0o700, parents=True, exist_ok=True)
    now = datetime.datetime.now(datetime.timezone.utc)

    def name_of(text: str) -> x509.Name:
        return x509.Name([x509.NameAttribute(NameOID.COMMON_NAME, text)])

    def begin(subject: str, key: ec.EllipticCurvePrivateKey) -> x509.CertificateBuilder:
        return (
            x509.CertificateBuilder()
            .subject_name(name_of(subject))
            .issuer_name(name_of("wavecomb farm"))
            .public_key(key.public_key())
            .serial_number(x509.random_serial_number())
            # Clocks of machines differ.
            .not_valid_before(now - datetime.timedelta(hours=1))
            .not_valid_after(now + datetime.timedelta(days=days))
        )

    authority = ec.generate_private_key(ec.SECP256R1())
    signed = (
        begin("wavecomb farm", authority)
        .add_extension(x509.BasicConstraints(ca=True, path_length=0), critical=True)
        .add_extension(x509.SubjectKeyIdentifier.from_public_key(authority.public_key()), False)
        .add_extension(_usage(x509, signs=True), critical=True)
        .sign(authority, hashes.SHA256())
    )
    pem = serialization.Encoding.PEM
    written = [_write(place / "ca.pem", signed.public_bytes(pem))]
    for name in NAMES:
        key = ec.generate_private_key(ec.SECP256R1())
        own = (
            begin(f"wavecomb farm {name}", key)
            .add_extension(x509.BasicConstraints(ca=False, path_length=None), critical=True)
            .add_extension(_usage(x509, signs=False), critical=True)
            .add_extension(
                x509.AuthorityKeyIdentifier.from_issuer_public_key(authority.public_key()), False
            )
            .add_extension(
                x509.ExtendedKeyUsage(
                    [ExtendedKeyUsageOID.SERVER_AUTH, ExtendedKeyUsageOID.CLIENT_AUTH]
                ),
                False,
            )
            .sign(authority, hashes.SHA256())
        )
        written.append(_write(place / f"{name}.pem", own.public_bytes(pem)))
        text = key.private_bytes(
            pem, serialization.PrivateFormat.PKCS8, serialization.NoEncryption()
        )
        written.append(_write(place / f"{name}.key", text, 0o600))
    return written


def _usage(x509: object, *, signs: bool) -> object:
    """What a key is for: to sign certificates, or to talk."""
    names = ("content_commitment", "key_encipherment", "data_encipherment", "key_agreement")
    unused = dict.fromkeys((*names, "encipher_only", "decipher_only"), False)
    return x509.KeyUsage(  # type: ignore[attr-defined]
        digital_signature=not signs, key_cert_sign=signs, crl_sign=signs, **unused
    )


def _write(path: Path, data: bytes, mode: int = 0o644) -> Path:
    """Writes a file that is not there yet; its rights are these from its first byte on."""
    number = os.open(path, os.O_WRONLY | os.O_CREAT | os.O_EXCL, mode)
    with os.fdopen(number, "wb") as file:
        file.write(data)
    return path
