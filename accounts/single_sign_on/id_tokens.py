"""Verifies the ID tokens of an OpenID Connect provider: signature, issuer, audience, time and nonce."""

from base64 import urlsafe_b64encode
from collections.abc import Callable, Mapping
from hashlib import sha256
from hmac import compare_digest
from typing import Any

import jwt
from allauth.socialaccount.providers.oauth2.client import OAuth2Error

# Signatures by a key that only the provider has; never those by a shared secret, and never none
ALGORITHMS = ("RS256", "RS384", "RS512", "PS256", "PS384", "PS512", "ES256", "ES384", "ES512", "EdDSA")
CLOCKS_DIFFER_S = 60
REQUIRED = ["iss", "sub", "aud", "exp", "iat"]


def nonce_of(verifier: str) -> str:
    """The nonce of a log-in, derived from its PKCE code verifier: a secret of the browser's session."""
    return urlsafe_b64encode(sha256(f"nonce {verifier}".encode()).digest()).decode().rstrip("=")


def verified_claims(
    token: str, *, keys: Callable[[], Mapping[str, Any]], issuer: str, client_id: str, nonce: str
) -> dict[str, object]:
    """The claims of an ID token. ``keys``: reads the provider's JSON Web Key Set. Raises OAuth2Error."""
    try:
        header = jwt.get_unverified_header(token)
        if header.get("alg") not in ALGORITHMS:
            raise OAuth2Error(f"the ID token is signed by {header.get('alg')!r}")
        claims = jwt.decode(
            token,
            _key(jwt.PyJWKSet.from_dict(dict(keys())), header),
            algorithms=[header["alg"]],
            audience=client_id,
            issuer=issuer,
            leeway=CLOCKS_DIFFER_S,
            options={"require": REQUIRED},
        )
    except (jwt.PyJWTError, TypeError, ValueError) as error:
        raise OAuth2Error(f"the ID token is invalid: {error}") from error
    if claims.get("azp", client_id) != client_id:
        raise OAuth2Error("the ID token was made for another client")
    if not compare_digest(str(claims.get("nonce", "")).encode(), nonce.encode()):
        raise OAuth2Error("the ID token belongs to another log-in: its nonce differs")
    return claims


def _key(keys: jwt.PyJWKSet, header: Mapping[str, Any]) -> jwt.PyJWK:
    """The key that the header names, or the only one. Raises OAuth2Error."""
    signing = [key for key in keys.keys if key.public_key_use in (None, "sig")]
    found = [key for key in signing if key.key_id == header.get("kid")] if header.get("kid") else signing
    if len(found) != 1:
        raise OAuth2Error(f"the provider has no key {header.get('kid')!r}")
    return found[0]
