"""Tokens, the racer behind one, and the answer for addresses that do not exist."""

from __future__ import annotations

from allauth.account import app_settings as account_settings
from allauth.account.adapter import get_adapter
from allauth.account.models import EmailAddress
from allauth.core import ratelimit
from allauth.mfa.base.forms import AuthenticateForm
from django.contrib.auth.signals import user_logged_in, user_logged_out
from django.core.exceptions import ValidationError
from django.db.models import QuerySet
from django.utils import timezone
from django.utils.translation import gettext as _
from django.utils.translation import gettext_lazy
from drf_spectacular.utils import OpenApiResponse, extend_schema, extend_schema_view
from knox.models import AuthToken
from rest_framework import generics, serializers, status
from rest_framework.exceptions import APIException, NotFound, Throttled
from rest_framework.permissions import AllowAny, IsAuthenticated
from rest_framework.request import Request
from rest_framework.response import Response
from rest_framework.views import APIView

from accounts.countries import country_choices
from accounts.models import Racer
from accounts.profile import change_profile
from accounts.quotas import usage_of
from accounts.scopes import ANY, EVERY, RACE, SCOPES
from accounts.second_factor import factors_of, lacks_demanded_factor
from accounts.tokens import LONGEST_DAYS, create_token, revoke_token, scopes_of, tokens_of
from accounts.who import racer_of
from core.bodies import Body, read_as, refuse_fields

from .auth import SecondFactorMissing

TOO_MANY_ATTEMPTS_WAIT_S = 300


class WrongCredentials(APIException):
    """The name, address or password is wrong. Which of them is not said."""

    status_code = status.HTTP_400_BAD_REQUEST
    default_code = "wrong_credentials"
    default_detail = gettext_lazy("Alias, e-mail address or password is wrong.")


class AddressUnverified(APIException):
    """Logging in needs a verified e-mail address on this site."""

    status_code = status.HTTP_403_FORBIDDEN
    default_code = "email_unverified"
    default_detail = gettext_lazy("Verify your e-mail address first: follow the link in the message we sent you.")


class SecondFactorNeeded(APIException):
    """The password was right, and this racer has a second factor."""

    status_code = status.HTTP_403_FORBIDDEN
    default_code = "second_factor_needed"
    default_detail = gettext_lazy(
        "Send the code of your second factor too. If you only have a passkey, create a token in "
        "the settings on the site."
    )


class WrongCode(APIException):
    """The code of the second factor is wrong, used or too old."""

    status_code = status.HTTP_400_BAD_REQUEST
    default_code = "wrong_code"
    default_detail = gettext_lazy("The code is wrong or has already been used.")


class NoToken(APIException):
    """Only a request that came with a token can give it back."""

    status_code = status.HTTP_400_BAD_REQUEST
    default_code = "no_token"
    default_detail = gettext_lazy("Send the token to revoke in the header Authorization: Token ...")


class LoginSerializer(Body):
    """Who logs in."""

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
    country = serializers.CharField(allow_blank=True)
    team = serializers.CharField(allow_blank=True)
    is_staff = serializers.BooleanField(help_text="An admin.")
    joined_at = serializers.DateTimeField()


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

    country = serializers.ChoiceField(
        [("", ""), *country_choices()], required=False, allow_blank=True, help_text="Two-letter code, or empty."
    )
    team = serializers.CharField(
        required=False, allow_blank=True, max_length=64, help_text="Empty leaves it, a new name founds one."
    )


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


class TokenView(APIView):
    """Log in to the API and out of it."""

    token_scope = ANY

    def get_permissions(self) -> list:
        return [AllowAny() if self.request.method == "POST" else IsAuthenticated()]

    def get_authenticators(self) -> list:
        """A log-in needs no session, and an old token that is still sent must not stop it."""
        if self.request is not None and self.request.method == "POST":
            return []
        return super().get_authenticators()

    @extend_schema(
        operation_id="create_token",
        summary="Get a token for a password",
        request=LoginSerializer,
        responses={201: TokenSerializer},
        auth=[],
        tags=["account"],
    )
    def post(self, request: Request) -> Response:
        sent = read_as(LoginSerializer, request.data)
        racer = _authenticate(request, sent["login"], sent["password"])
        _show_second_factor(racer, sent.get("code", ""))
        wanted = {name: sent[name] for name in ("scopes", "days") if name in sent}
        token, text = create_token(racer=racer, now=timezone.now(), **wanted)
        user_logged_in.send(sender=Racer, request=request._request, user=racer)
        made = {"token": text, "alias": racer.alias, "scopes": token.grant.scopes, "expires_at": token.expiry}
        return Response(TokenSerializer(made).data, status=status.HTTP_201_CREATED)

    @extend_schema(
        operation_id="delete_token",
        summary="Give the token of this request back",
        request=None,
        responses={204: OpenApiResponse(description="It is void from now on.")},
        tags=["account"],
    )
    def delete(self, request: Request) -> Response:
        if request.auth is None:
            raise NoToken()
        refuse_fields(request)
        request.auth.delete()
        user_logged_out.send(sender=Racer, request=request._request, user=request.user)
        return Response(status=status.HTTP_204_NO_CONTENT)


class MeView(APIView):
    """Who the token belongs to."""

    token_scope = RACE
    permission_classes = [IsAuthenticated]

    @extend_schema(operation_id="me", summary="The racer behind the token", responses=RacerSerializer, tags=["account"])
    def get(self, request: Request) -> Response:
        return Response(RacerSerializer(request.user).data)

    @extend_schema(
        operation_id="change_profile",
        summary="Change country or team",
        request=ProfileBody,
        responses=RacerSerializer,
        tags=["account"],
    )
    def patch(self, request: Request) -> Response:
        racer = racer_of(request)
        sent = {"country": racer.country} | read_as(ProfileBody, request.data)
        return Response(RacerSerializer(change_profile(racer=racer, now=timezone.now(), **sent)).data)


@extend_schema_view(
    get=extend_schema(
        operation_id="list_tokens",
        summary="My tokens, the newest first",
        responses=KnownTokenSerializer,
        tags=["account"],
    )
)
class TokensView(generics.ListAPIView):
    """Which programs may act for me."""

    permission_classes = [IsAuthenticated]
    serializer_class = KnownTokenSerializer

    def get_queryset(self) -> QuerySet[AuthToken]:
        return tokens_of(racer_of(self.request), timezone.now())


class TokenRevocationView(APIView):
    """Locking a program out."""

    token_scope = EVERY
    permission_classes = [IsAuthenticated]

    @extend_schema(
        operation_id="revoke_token",
        summary="Revoke one of my tokens",
        request=None,
        responses={204: OpenApiResponse(description="Programs that use it are locked out from now on.")},
        tags=["account"],
    )
    def delete(self, request: Request, key: str) -> Response:
        refuse_fields(request)
        if not revoke_token(racer=racer_of(request), key=key):
            raise NotFound()
        return Response(status=status.HTTP_204_NO_CONTENT)


class UsageView(APIView):
    """What the racer may use of the site."""

    permission_classes = [IsAuthenticated]

    @extend_schema(
        operation_id="usage",
        summary="Every quota: how much the racer has used, and how much they may",
        responses=UsageSerializer(many=True),
        tags=["account"],
    )
    def get(self, request: Request) -> Response:
        return Response(UsageSerializer(usage_of(racer_of(request), timezone.now()), many=True).data)


@extend_schema(exclude=True)
class UnknownAddressView(APIView):
    """Anything below /api/ that is nothing: not found, in the API's own form."""

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
    if racer is None or not racer.is_active:
        raise WrongCredentials()
    if account_settings.EMAIL_VERIFICATION == account_settings.EmailVerificationMethod.MANDATORY:
        _require_verified_address(racer)
    return racer


def _show_second_factor(racer: Racer, code: str) -> None:
    """The password is not enough where there is more. Shares allauth's limit on wrong codes."""
    if lacks_demanded_factor(racer):
        raise SecondFactorMissing()
    if not factors_of(racer).exists():
        return
    if not code:
        raise SecondFactorNeeded()
    form = AuthenticateForm(user=racer, data={"code": code})
    if not form.is_valid():
        if form.has_error("code", "too_many_login_attempts"):
            raise Throttled(wait=TOO_MANY_ATTEMPTS_WAIT_S)
        raise WrongCode()
    form.authenticator.record_usage()


def _require_verified_address(racer: Racer) -> None:
    if not EmailAddress.objects.filter(user=racer, verified=True).exists():
        raise AddressUnverified()
