"""The site's key pair, by which platforms know that a token request or a chosen link is the site's."""

from collections.abc import Mapping
from functools import lru_cache
from typing import Any

from cryptography.hazmat.primitives.asymmetric import rsa
from cryptography.hazmat.primitives.serialization import (
    Encoding,
    NoEncryption,
    PrivateFormat,
    PublicFormat,
    load_pem_private_key,
)
from django.conf import settings

from core.files.secret_files import secret_from_file


def private_key() -> str:
    """The private key (PEM) of PADDOCK_LTI_KEY_FILE, made on first use. Platforms fetch a new one by its address."""
    return secret_from_file(settings.LTI_KEY_FILE, _new_key)


def public_key() -> str:
    """The public key (PEM)."""
    return _public_of(private_key())


def key_set() -> dict[str, list[Mapping[str, Any]]]:
    """The public key as a JSON Web Key Set, under the name that the library signs with."""
    from pylti1p3.registration import Registration

    return {"keys": [Registration.get_jwk(public_key())]}


def _new_key() -> str:
    key = rsa.generate_private_key(public_exponent=65537, key_size=2048)
    return key.private_bytes(Encoding.PEM, PrivateFormat.PKCS8, NoEncryption()).decode()


@lru_cache(maxsize=2)
def _public_of(private: str) -> str:
    key = load_pem_private_key(private.encode(), None)
    return key.public_key().public_bytes(Encoding.PEM, PublicFormat.SubjectPublicKeyInfo).decode()
