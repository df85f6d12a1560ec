"""The library (PyLTI1p3) with what it leaves open: registered platforms, one use of each log-in, RS256 alone."""

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from hmac import compare_digest
from time import time
from typing import Any

from django.conf import settings
from django.core.cache import cache
from django.http import HttpRequest, HttpResponse
from jwcrypto.common import JWException
from pylti1p3.contrib.django import DjangoMessageLaunch, DjangoOIDCLogin
from pylti1p3.deployment import Deployment
from pylti1p3.exception import LtiException, OIDCException
from pylti1p3.registration import Registration
from pylti1p3.session import SessionService
from pylti1p3.tool_config import ToolConfAbstract

from paddock.errors import UserFault

from ..models import LtiPlatform
from . import keys
from .asking import PlatformSession

LOG_IN_S = 300  # from the platform's request to its token; the library's cookie lasts as long
KEYS_S, KEYS_AGAIN_S = 3600, 60
CLOCK_S = 60  # how far a platform's clock may be ahead
LONGEST_TOKEN, LONGEST_PARAMETER = 1 << 16, 1 << 12
PARAMETERS = ("iss", "login_hint", "target_link_uri", "lti_message_hint", "lti_deployment_id", "client_id")
ALGORITHM = "RS256"  # of LTI 1.3
# the library checks the audience itself; a clock that is ahead is allowed a minute
_CHECKS: Any = {"verify_aud": False, "verify_iat": False, "require": ["exp", "iat", "iss", "aud", "sub", "nonce"]}


def registration_of(platform: LtiPlatform) -> Registration:
    """A platform as the library takes it."""
    found = Registration()
    found.set_issuer(platform.issuer).set_client_id(platform.client_id)
    found.set_auth_login_url(platform.authorize_url).set_auth_token_url(platform.token_url)
    found.set_key_set_url(platform.jwks_url)
    found.set_tool_private_key(keys.private_key()).set_tool_public_key(keys.public_key())
    if platform.audience:
        found.set_auth_audience(platform.audience)
    return found


class Platforms(ToolConfAbstract):
    """The registered platforms. ``found``: the one that the library has asked for."""

    found: LtiPlatform | None = None

    def check_iss_has_one_client(self, iss: str) -> bool:
        return False

    def find_registration_by_issuer(self, iss: str, *args: Any, **kwargs: Any) -> Registration:
        raise NotImplementedError  # the library asks so where an issuer has one client only

    def find_deployment(self, iss: str, deployment_id: str) -> Deployment | None:
        raise NotImplementedError

    def find_registration_by_params(self, iss: str, client_id: str | None, *args: Any, **kwargs: Any) -> Any:
        """A log-in may leave the client out where the issuer has only one."""
        if not isinstance(iss, str) or not isinstance(client_id, str | None):
            return None
        rows = LtiPlatform.objects.filter(issuer=iss, is_active=True)
        found = list((rows.filter(client_id=client_id) if client_id else rows)[:2])
        self.found = found[0] if len(found) == 1 else None
        return registration_of(self.found) if self.found else None

    def find_deployment_by_params(
        self, iss: str, deployment_id: str, client_id: str, *args: Any, **kwargs: Any
    ) -> Deployment | None:
        known = self.found is not None and deployment_id in self.found.deployments
        return Deployment().set_deployment_id(deployment_id) if known else None


class OneLogIn(SessionService):
    """State and nonce of a log-in in the cache: for five minutes, and for one launch. Nothing else is kept."""

    def __init__(self, request: HttpRequest) -> None:
        self._state, self._nonce = request.POST.get("state", ""), ""

    def save_nonce(self, nonce: str) -> None:
        self._nonce = nonce

    def save_state_params(self, state: str, params: dict[str, object]) -> None:
        cache.set(_key(state), {**params, "nonce": self._nonce}, LOG_IN_S)

    def check_state_is_valid(self, state: str, id_token_hash: str) -> bool:
        return False  # so that the library compares it with the browser's cookie

    def check_nonce(self, nonce: Any) -> bool:
        """Use the log-in up, whatever comes of it. ``platform`` is the id of the one that was logged in to."""
        key = _key(self._state)
        kept = cache.get(key)
        if not cache.delete(key) or kept is None or not isinstance(nonce, str):
            return False
        self.platform = kept["platform"]
        return compare_digest(kept["nonce"].encode(), nonce.encode())


class LogIn(DjangoOIDCLogin):
    """The library's log-in, which keeps the platform with the nonce."""

    def validate_oidc_login(self) -> Registration:
        found = super().validate_oidc_login()
        self.pass_params_to_launch({"platform": self._tool_config.found.pk})
        return found


class Message(DjangoMessageLaunch):
    """The library's launch, with RS256 alone and the platform's keys for an hour."""

    def validate_jwt_format(self) -> "Message":
        if len(self._get_id_token()) > LONGEST_TOKEN:
            raise LtiException("The token is too long")
        super().validate_jwt_format()
        head, body = self._jwt["header"], self._jwt["body"]
        if not isinstance(head, dict) or not isinstance(body, dict) or head.get("alg") != ALGORITHM:
            raise LtiException("Not a token of LTI 1.3")
        return self

    def validate_jwt_signature(self) -> "Message":
        super().validate_jwt_signature()
        body: Mapping[str, object] = self._jwt["body"]
        client = self.get_client_id()
        if body.get("azp", client) != client or (len(_list(body["aud"])) > 1 and "azp" not in body):
            raise LtiException("The token is for another client")
        if not isinstance(body["iat"], int | float) or body["iat"] > time() + CLOCK_S:
            raise LtiException("The token is not yet valid")
        return self

    def fetch_public_key(self, key_set_url: str) -> Any:
        """The RSA keys at this address; asked for again where the token names an unknown one, once a minute."""
        key, again = f"lti-keys-{key_set_url}", f"lti-keys-again-{key_set_url}"
        kept = cache.get(key)
        wanted = self._jwt["header"].get("kid")
        if kept is None or (wanted not in {one.get("kid") for one in kept} and cache.add(again, 1, KEYS_AGAIN_S)):
            try:
                answer = self._requests_session.get(key_set_url).json()
                kept = [one for one in answer["keys"] if one.get("kty") == "RSA" and one.get("alg", "RS256") == "RS256"]
            except (ValueError, LookupError, TypeError, AttributeError) as error:
                raise LtiException("The key set cannot be read") from error
            cache.set(key, kept, KEYS_S)
        return {"keys": kept}


def log_in(request: HttpRequest, launch_url: str) -> HttpResponse:
    """The way to the platform, with the cookie of this log-in. Raises UserFault("lti_log_in" |
    "lti_platform_unknown")."""
    sent = {name: request.GET.get(name) or request.POST.get(name) or "" for name in PARAMETERS}
    if not sent["iss"] or not sent["login_hint"] or any(len(value) > LONGEST_PARAMETER for value in sent.values()):
        raise UserFault("lti_log_in")
    try:
        answer: HttpResponse = LogIn(request, Platforms(), session_service=OneLogIn(request)).redirect(launch_url)
    except OIDCException as error:
        raise UserFault("lti_platform_unknown") from error
    for cookie in answer.cookies.values() if settings.BEHIND_HTTPS else ():  # the way back is from another site
        cookie["secure"], cookie["samesite"] = True, "None"
    return answer


def checked_message(request: HttpRequest) -> tuple[LtiPlatform, Message]:
    """The platform and its message, after every check. Raises UserFault("lti_expired" | "lti_token" |
    "lti_platform_unknown" | "lti_deployment" | "lti_message"), and as :class:`PlatformSession` does."""
    platforms, once = Platforms(), OneLogIn(request)
    message = Message(request, platforms, session_service=once, requests_session=PlatformSession())
    message.set_auto_validation(False).set_jwt_verify_options(_CHECKS)
    with _as("lti_expired"):
        message.validate_state()
    with _as("lti_token"):
        message.validate_jwt_format()
    with _as("lti_expired"):
        message.validate_nonce()
    with _as("lti_platform_unknown"):
        message.validate_registration()
    platform = platforms.found
    if platform is None or platform.pk != once.platform:
        raise UserFault("lti_platform_unknown")
    with _as("lti_token"):
        message.validate_jwt_signature()
    with _as("lti_deployment"):
        message.validate_deployment()
    with _as("lti_message"):
        message.validate_message()
    return platform, message


def _list(found: Any) -> list[Any]:
    return found if isinstance(found, list) else [found]


def _key(state: str) -> str:
    return f"lti-log-in-{state[:100]}"


@contextmanager
def _as(code: str) -> Iterator[None]:
    """What the library refuses, and what it stumbles over in a malformed token, as a fault of the sender."""
    try:
        yield
    except (LtiException, JWException, ValueError, LookupError, TypeError, AttributeError) as error:
        raise UserFault(code) from error
