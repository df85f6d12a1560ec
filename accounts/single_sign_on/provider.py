"""The providers as django-allauth knows them: OpenID Connect, and a directory asked through LDAP."""

from collections.abc import Iterator
from contextlib import contextmanager
from hashlib import sha256
from typing import Any, Final, NotRequired, TypedDict

from allauth.account.models import EmailAddress
from allauth.socialaccount.adapter import get_adapter
from allauth.socialaccount.models import SocialApp, SocialLogin, SocialToken
from allauth.socialaccount.providers.base import Provider, ProviderAccount
from allauth.socialaccount.providers.oauth2.client import OAuth2Error
from allauth.socialaccount.providers.openid_connect.provider import OpenIDConnectProvider
from allauth.socialaccount.providers.openid_connect.views import OpenIDConnectOAuth2Adapter
from django.conf import settings
from django.http import HttpRequest

from .id_tokens import nonce_of, verified_claims

NAMED_GROUPS = frozenset(group for group, _ in settings.SSO_ROLES)
# How a person showed more than a password, by RFC 8176
SEVERAL_FACTORS: Final = "mfa"


class PersonDocument(TypedDict):
    """A person as a provider knows them; ``groups``: None where it has no groups."""

    uid: str
    name: str
    email: object
    email_verified: bool
    groups: list[str] | None
    mfa: bool


class OpenIDConfiguration(TypedDict):
    issuer: str
    authorization_endpoint: str
    token_endpoint: str
    jwks_uri: str
    userinfo_endpoint: NotRequired[str]


def digest_of(*parts: str) -> str:
    """One short text for several: a person's id is unique within its provider only, and may be long."""
    return sha256("\n".join(parts).encode()).hexdigest()


def values_at(claims: Any, path: str) -> list[str]:
    """The texts of a claim, a list of texts or one; ``path`` may lead into objects: ``realm_access.roles``."""
    found = claims.get(path) if path in claims else claims
    for step in path.split(".") if path not in claims else ():
        found = found.get(step) if isinstance(found, dict) else None
    return [str(value) for value in (found if isinstance(found, list) else [found]) if value]


class PersonProvider(Provider):
    """What both kinds share: which of a person's data are kept. The groups are those that PADDOCK_SSO_GROUPS names."""

    account_class = ProviderAccount

    def extract_uid(self, data: PersonDocument) -> str:
        return str(data["uid"])

    def extract_common_fields(self, data: PersonDocument) -> dict[str, object]:
        return {"email": data["email"], "username": data["name"]}

    def extract_email_addresses(self, data: PersonDocument) -> list[EmailAddress]:
        email = str(data["email"] or "").lower()
        return [EmailAddress(email=email, verified=data["email_verified"], primary=True)] if email else []

    def extract_extra_data(self, data: PersonDocument) -> dict[str, object]:
        groups = data["groups"]
        if groups is not None:
            groups = [name for name in groups if name.casefold() in NAMED_GROUPS]
        return {"username": data["name"], "groups": groups, SEVERAL_FACTORS: data[SEVERAL_FACTORS]}


class ProviderAnswers(OpenIDConnectOAuth2Adapter):
    """allauth's client of the provider. Tokens must be signed and belong to this log-in, however they were fetched."""

    _nonce = ""

    @property
    def openid_config(self) -> OpenIDConfiguration:
        """The provider's description of itself. Raises OAuth2Error for none, and for that of another provider."""
        with provider_errors():
            found = super().openid_config
            if found["issuer"].rstrip("/") != settings.OIDC["issuer"]:
                raise OAuth2Error(f"the provider calls itself {found['issuer']}, not {settings.OIDC['issuer']}")
            _ = found["authorization_endpoint"], found["token_endpoint"], found["jwks_uri"]
        return found

    def get_access_token_data(
        self, request: HttpRequest, app: SocialApp, client: Any, pkce_code_verifier: str | None = None
    ) -> dict[str, object]:
        self._nonce = nonce_of(pkce_code_verifier or "")
        with provider_errors():
            return super().get_access_token_data(request, app, client, pkce_code_verifier=pkce_code_verifier)

    def complete_login(self, request: HttpRequest, app: SocialApp, token: SocialToken, **kwargs: Any) -> SocialLogin:
        """The person of verified tokens; claims of the userinfo endpoint go before those of the ID token."""
        with provider_errors():
            claims = verified_claims(
                kwargs["response"]["id_token"],
                keys=self.keys,
                issuer=self.openid_config["issuer"],
                client_id=app.client_id,
                nonce=self._nonce,
            )
            if "userinfo_endpoint" in self.openid_config:
                more = self._fetch_user_info(token.token)
                if more["sub"] != claims["sub"]:
                    raise OAuth2Error("the provider answered about another person")
                claims |= more
        return self.get_provider().person(request, claims)

    def keys(self) -> dict[str, object]:
        """The provider's JSON Web Key Set. Raises OAuth2Error and RequestException."""
        with provider_errors(), get_adapter().get_requests_session() as session:
            response = session.get(self.openid_config["jwks_uri"])
            response.raise_for_status()
            return dict(response.json())


@contextmanager
def provider_errors() -> Iterator[None]:
    """Answers that are no JSON or lack something become OAuth2Error. Connections that fail stay RequestException."""
    try:
        yield
    except (LookupError, TypeError, ValueError, AttributeError) as error:
        # requests' own errors of a connection are OSError; only its "no JSON" is a ValueError
        raise OAuth2Error(f"the provider's answer is incomplete: {error!r}") from error


class OpenIDConnect(PersonProvider, OpenIDConnectProvider):
    """The provider of PADDOCK_OIDC_ISSUER, always with PKCE and a nonce."""

    oauth2_adapter_class = ProviderAnswers
    account_class = ProviderAccount

    def get_pkce_params(self) -> dict[str, str]:
        found = super().get_pkce_params()
        return found | {"nonce": nonce_of(found["code_verifier"])}

    def person(self, request: HttpRequest, claims: dict[str, object]) -> SocialLogin:
        """A log-in of the person with these claims. An address counts as verified by the word ``true`` alone."""
        used = values_at(claims, "amr")
        data: PersonDocument = {
            "uid": digest_of(settings.OIDC["issuer"], str(claims["sub"])),
            "name": str(claims.get("preferred_username") or claims.get("nickname") or ""),
            "email": claims.get("email"),
            "email_verified": claims.get("email_verified") is True or claims.get("email_verified") == "true",
            "groups": values_at(claims, settings.OIDC["groups_claim"]),
            SEVERAL_FACTORS: SEVERAL_FACTORS in used,
        }
        return self.sociallogin_from_response(request, data)


class DirectoryProvider(PersonProvider):
    """The directory of PADDOCK_LDAP_URI."""

    id = "ldap"
    uses_apps = False

    @property
    def name(self) -> str:
        return settings.LDAP["label"]


provider_classes = ([OpenIDConnect] if settings.OIDC else []) + ([DirectoryProvider] if settings.LDAP else [])
