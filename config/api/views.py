"""Tokens, the racer behind one, and the answer for addresses that do not exist."""

from typing import Any, NotRequired, TypedDict

from allauth.account import app_settings as account_settings
from allauth.account.adapter import get_adapter
from allauth.account.models import EmailAddress
from allauth.core import ratelimit
from allauth.mfa.base.forms import AuthenticateForm
from django.contrib.auth.signals import user_logged_in, user_logged_out
from django.core.exceptions import ValidationError
from django.db.models import QuerySet
from django.http import HttpResponseBase
from django.utils import timezone
from django.utils.translation import gettext as _
from drf_spectacular.utils import extend_schema
from knox.models import AuthToken
from rest_framework import serializers, status
from rest_framework.exceptions import NotFound, Throttled
from rest_framework.permissions import AllowAny, IsAuthenticated
from rest_framework.request import Request
from rest_framework.response import Response

from accounts.leaving.downloads import download_of_data
from accounts.leaving.services import check_own_deletion, delete_account
from accounts.models import ALIAS_VALIDATORS, Racer
from accounts.profile.aliases import change_alias
from accounts.profile.fields import editable
from accounts.profile.services import change_profile
from accounts.quotas import Usage
from accounts.request_racer import racer_of
from accounts.scopes import ANY, EVERY, RACE, SCOPES
from accounts.signing_in.second_factor import factors_of, lacks_demanded_factor
from accounts.tokens.services import LONGEST_DAYS, create_token, revoke_token, scopes_of, tokens_of
from accounts.usage.selectors import usage_of
from core.api.bodies import Body
from core.api.operations import ZIP, operation
from core.api.views import APIView, FileView, PrivateView
from paddock.errors import UserFault

from .auth import SecondFactorMissing

TOO_MANY_ATTEMPTS_WAIT_S = 300


class LoginSerializer(Body):
    """The log-in form: name, password and second factor."""

    login = serializers.CharField(max_length=254, help_text="Alias or e-mail address.")
    password = serializers.CharField(max_length=1024, trim_whitespace=False, style={"input_type": "password"})
    code = serializers.CharField(
        max_length=32, required=False, help_text="Of the second factor, where the racer has one: an app's, or on paper."
    )
    scopes = serializers.ListField(
        child=serializers.ChoiceField(SCOPES),
        required=False,
        allow_empty=False,
        max_length=len(SCOPES),
        help_text="What the token is for. All if left out.",
    )
    days = serializers.IntegerField(
        required=False, min_value=1, max_value=LONGEST_DAYS, help_text="How long it holds; the site has a usual time."
    )


class SentLogin(TypedDict):
    """What :class:`LoginSerializer` reads."""

    login: str
    password: str
    code: NotRequired[str]
    scopes: NotRequired[list[str]]
    days: NotRequired[int]


class TokenSerializer(serializers.Serializer):
    """A new token."""

    token = serializers.CharField(help_text="Shown once: only a hash of it is kept.")
    alias = serializers.CharField()
    scopes = serializers.ListField(child=serializers.ChoiceField(SCOPES), help_text="What it may be used for.")
    expires_at = serializers.DateTimeField(help_text="From then on it is void.")


class RacerSerializer(serializers.Serializer):
    """The racer behind the token."""

    alias = serializers.CharField()
    email = serializers.EmailField()
    team = serializers.CharField(allow_blank=True)
    is_staff = serializers.BooleanField(help_text="An admin.")
    joined_at = serializers.DateTimeField()

    def get_fields(self) -> dict[str, serializers.Field]:
        return {**super().get_fields(), **{name: field.api() for name, field in editable().items()}}


class UsageSerializer(serializers.Serializer):
    """How much of one quota the racer has used."""

    name = serializers.CharField(help_text="Stable: models, storage_mb, tracks, races, trainings_at_once, ...")
    label = serializers.CharField(  # type: ignore[assignment]  # a field called label, of a field that has one
        source="quota.label", help_text="What is counted, in the reader's language."
    )
    used = serializers.FloatField(min_value=0)
    limit = serializers.IntegerField(min_value=0)
    own = serializers.BooleanField(help_text="An admin has set this limit for the racer alone.")


class ProfileBody(Body):
    """What a racer may change about themselves; what is left out stays."""

    team = serializers.CharField(
        required=False, allow_blank=True, max_length=64, help_text="Empty leaves it, a new name founds one."
    )

    def get_fields(self) -> dict[str, serializers.Field]:
        bodies = {name: field.body() for name, field in editable().items() if field.body is not None}
        return {**super().get_fields(), **bodies}


class KnownTokenSerializer(serializers.Serializer):
    """One of the racer's tokens, without the token."""

    key = serializers.CharField(source="token_key", help_text="The letters that it begins with.")
    created_at = serializers.DateTimeField(source="created")
    scopes = serializers.SerializerMethodField(help_text="What it may be used for.")
    expires_at = serializers.DateTimeField(source="expiry", allow_null=True, help_text="Null for never.")
    last_used_at = serializers.DateTimeField(
        source="grant.last_used_at", default=None, allow_null=True, help_text="To ten minutes."
    )
    is_this_one = serializers.SerializerMethodField(help_text="The token of this very request.")

    def get_scopes(self, token: AuthToken) -> list[str]:
        return scopes_of(token)

    def get_is_this_one(self, token: AuthToken) -> bool:
        return token == self.context["request"].auth


def _token(request: Request) -> AuthToken:
    if request.auth is None:
        raise UserFault("no_token")
    return request.auth


class TokenView(APIView):
    token_scope = ANY
    slow_methods = ("POST",)

    def get_permissions(self) -> list:
        return [AllowAny() if self.request.method == "POST" else IsAuthenticated()]

    def get_authenticators(self) -> list:
        """A log-in needs no session, and an old token that is still sent must not stop it."""
        if self.request is not None and self.request.method == "POST":
            return []
        return super().get_authenticators()

    @operation(
        "create_token", "Get a token for a password", body=LoginSerializer, answer=TokenSerializer, status=201, auth=[]
    )
    def post(self, request: Request, sent: SentLogin) -> Response:
        racer = _authenticate(request, sent["login"], sent["password"])
        _show_second_factor(racer, sent.get("code", ""))
        scopes, days = sent.get("scopes", SCOPES), sent.get("days")

        def make() -> Response:
            token, text = create_token(racer=racer, now=timezone.now(), scopes=scopes, days=days)
            user_logged_in.send(sender=Racer, request=request._request, user=racer)
            made = {"token": text, "alias": racer.alias, "scopes": token.grant.scopes, "expires_at": token.expiry}
            return Response(TokenSerializer(made).data, status=status.HTTP_201_CREATED)

        return self.write(make, racer=racer)

    @operation("delete_token", "Give the token of this request back", find=_token, answer="It is void from now on.")
    def delete(self, request: Request, token: AuthToken) -> None:
        token.delete()
        user_logged_out.send(sender=Racer, request=request._request, user=request.user)


class MeView(PrivateView):
    token_scope = RACE

    @operation("me", "The racer behind the token", answer=RacerSerializer)
    def get(self, request: Request) -> Racer:
        return racer_of(request)

    @operation("change_profile", "Change country or team", body=ProfileBody, answer=RacerSerializer)
    def patch(self, request: Request, sent: dict[str, Any]) -> Racer:
        team = sent.pop("team", None)
        return change_profile(racer=racer_of(request), values=sent, team=team, now=timezone.now())


class AliasBody(Body):
    """Another alias."""

    alias = serializers.CharField(
        max_length=64, validators=ALIAS_VALIDATORS, help_text="2 to 64 letters, digits, - and _."
    )


class AliasView(PrivateView):
    token_scope = EVERY

    @operation("change_alias", "Change my alias, once in some days", body=AliasBody, answer=RacerSerializer)
    def post(self, request: Request, sent: dict[str, str]) -> Racer:
        return change_alias(racer=racer_of(request), alias=sent["alias"], now=timezone.now())


class OwnDataView(PrivateView, FileView):
    read_scopes = SCOPES

    @operation(
        "download_data",
        "All personal data of the racer",
        answer=ZIP,
        description="A zip of JSON by section with the racer's files; its README lists the contents.",
    )
    def get(self, request: Request) -> HttpResponseBase:
        return download_of_data(racer=racer_of(request), now=timezone.now())


class DeletionBody(Body):
    """The confirmation of a deletion: alias and password once more, and the second factor where there is one."""

    alias = serializers.CharField(max_length=64, help_text="Your alias, exactly.")
    password = serializers.CharField(max_length=1024, trim_whitespace=False, style={"input_type": "password"})
    code = serializers.CharField(
        max_length=32, required=False, help_text="Of the second factor, where the racer has one: an app's, or on paper."
    )


class DeletionView(APIView):
    token_scope = EVERY
    slow_methods = ("POST",)

    @operation(
        "delete_account",
        "Delete the account of this token for good",
        body=DeletionBody,
        answer="Results stay without the name; all else is gone, this token as well.",
    )
    def post(self, request: Request, sent: dict[str, str]) -> None:
        racer = racer_of(request)
        check_own_deletion(racer=racer, now=timezone.now())
        if sent["alias"] != racer.alias:
            raise UserFault("account_not_confirmed")
        confirmed = _authenticate(request, racer.alias, sent["password"])
        _show_second_factor(confirmed, sent.get("code", ""))
        delete_account(racer=racer, by=racer, now=timezone.now())


class TokensView(PrivateView):
    @operation("list_tokens", "My tokens, the newest first", answer=KnownTokenSerializer, paged=True)
    def get(self, request: Request) -> QuerySet[AuthToken]:
        return tokens_of(racer_of(request), timezone.now())


def own_token(request: Request, key: str) -> AuthToken:
    token = AuthToken.objects.filter(user=racer_of(request), token_key=key).first()
    if token is None:
        raise NotFound()
    return token


class TokenRevocationView(APIView):
    token_scope = EVERY

    @operation(
        "revoke_token",
        "Revoke one of my tokens",
        find=own_token,
        answer="Programs that use it are locked out from now on.",
    )
    def delete(self, request: Request, token: AuthToken) -> None:
        revoke_token(racer=racer_of(request), key=token.token_key)


class UsageView(PrivateView):
    @operation(
        "usage",
        "Every quota: how much the racer has used, and how much they may",
        answer=UsageSerializer,
        many=True,
    )
    def get(self, request: Request) -> list[Usage]:
        return usage_of(racer_of(request), timezone.now())


@extend_schema(exclude=True)
class UnknownAddressView(APIView):
    """404 in the API's own form for unknown addresses below /api/."""

    permission_classes = [AllowAny]
    authentication_classes = []

    def initial(self, request: Request, rest: str) -> None:
        if rest.endswith("/"):
            raise NotFound(_("This address does not exist. All operations are listed at /api/schema/."))
        raise NotFound(_("This address does not exist. API addresses end with a slash."))


def _authenticate(request: Request, login: str, password: str) -> Racer:
    """The racer with these credentials. Shares allauth's limits on attempts with the site's own form."""
    if not ratelimit.consume(request._request, action="login"):
        raise Throttled(wait=60)
    credentials = {"email" if "@" in login else "username": login, "password": password}
    try:
        racer = get_adapter().authenticate(request._request, **credentials)
    except ValidationError:
        raise Throttled(wait=TOO_MANY_ATTEMPTS_WAIT_S) from None
    if hasattr(request._request, "unlinked_person"):
        raise UserFault("sso_first_log_in")
    if racer is None and (fault := getattr(request._request, "directory_fault", None)):
        raise fault
    if racer is None or not racer.is_active:
        raise UserFault("wrong_credentials")
    must_verify = account_settings.EMAIL_VERIFICATION == account_settings.EmailVerificationMethod.MANDATORY
    if must_verify and not EmailAddress.objects.filter(user=racer, verified=True).exists():
        raise UserFault("email_unverified")
    return racer


def _show_second_factor(racer: Racer, code: str) -> None:
    """The password is not enough where there is more. Shares allauth's limit on wrong codes."""
    if lacks_demanded_factor(racer):
        raise SecondFactorMissing()
    if not factors_of(racer).exists():
        return
    if not code:
        raise UserFault("second_factor_needed")
    form = AuthenticateForm(user=racer, data={"code": code})
    if not form.is_valid():
        if form.has_error("code", "too_many_login_attempts"):
            raise Throttled(wait=TOO_MANY_ATTEMPTS_WAIT_S)
        raise UserFault("wrong_code")
    form.authenticator.record_usage()
