"""Tokens, the racer behind one, and the answer for addresses that do not exist."""

from __future__ import annotations

from allauth.account import app_settings as account_settings
from allauth.account.adapter import get_adapter
from allauth.account.models import EmailAddress
from allauth.core import ratelimit
from django.contrib.auth.signals import user_logged_in, user_logged_out
from django.core.exceptions import ValidationError
from django.utils import timezone
from django.utils.translation import gettext as _
from django.utils.translation import gettext_lazy
from drf_spectacular.utils import OpenApiResponse, extend_schema
from rest_framework import serializers, status
from rest_framework.exceptions import APIException, NotFound, Throttled
from rest_framework.permissions import AllowAny, IsAuthenticated
from rest_framework.request import Request
from rest_framework.response import Response
from rest_framework.views import APIView

from accounts.quotas import usage_of
from league.models import Racer
from league.tokens import create_token
from tracks.bodies import Body, refuse_fields

TOO_MANY_ATTEMPTS_WAIT_S = 300


class WrongCredentials(APIException):
    """The name, address or password is wrong. Which of them is not said."""

    status_code = status.HTTP_400_BAD_REQUEST
    default_code = "wrong_credentials"
    default_detail = gettext_lazy("The alias or e-mail address and the password do not belong together.")


class AddressUnverified(APIException):
    """Logging in needs a verified e-mail address on this site."""

    status_code = status.HTTP_403_FORBIDDEN
    default_code = "email_unverified"
    default_detail = gettext_lazy("Verify your e-mail address first: follow the link in the message we sent you.")


class NoToken(APIException):
    """Only a request that came with a token can give it back."""

    status_code = status.HTTP_400_BAD_REQUEST
    default_code = "no_token"
    default_detail = gettext_lazy("Send the token that is to end in the header Authorization: Token ...")


class LoginSerializer(Body):
    """Who logs in."""

    login = serializers.CharField(max_length=254, help_text="Alias or e-mail address.")
    password = serializers.CharField(max_length=1024, trim_whitespace=False, style={"input_type": "password"})


class TokenSerializer(serializers.Serializer):
    """A new token."""

    token = serializers.CharField(help_text="Shown once: only a hash of it is kept.")
    alias = serializers.CharField()


class RacerSerializer(serializers.Serializer):
    """The racer behind the token."""

    alias = serializers.CharField()
    email = serializers.EmailField()
    country = serializers.CharField(allow_blank=True)
    is_staff = serializers.BooleanField(help_text="An admin.")
    joined_at = serializers.DateTimeField()


class UsageSerializer(serializers.Serializer):
    """How much of one quota the racer has used."""

    name = serializers.CharField(help_text="Stable: models, storage_mb, tracks, races, trainings_at_once, ...")
    label = serializers.CharField(source="quota.label", help_text="What is counted, in the reader's language.")
    used = serializers.FloatField(min_value=0)
    limit = serializers.IntegerField(min_value=0)
    own = serializers.BooleanField(help_text="An admin has set this limit for the racer alone.")


class TokenView(APIView):
    """Log in to the API and out of it."""

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
        serializer = LoginSerializer(data=request.data)
        serializer.is_valid(raise_exception=True)
        racer = _authenticate(request, **serializer.validated_data)
        token = create_token(racer=racer)
        user_logged_in.send(sender=Racer, request=request._request, user=racer)
        return Response({"token": token, "alias": racer.alias}, status=status.HTTP_201_CREATED)

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

    permission_classes = [IsAuthenticated]

    @extend_schema(operation_id="me", summary="The racer behind the token", responses=RacerSerializer, tags=["account"])
    def get(self, request: Request) -> Response:
        return Response(RacerSerializer(request.user).data)


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
        return Response(UsageSerializer(usage_of(request.user, timezone.now()), many=True).data)


@extend_schema(exclude=True)
class UnknownAddressView(APIView):
    """Anything below /api/ that is nothing: not found, in the API's own form."""

    permission_classes = [AllowAny]
    authentication_classes = []

    def initial(self, request: Request, rest: str) -> None:
        if rest.endswith("/"):
            raise NotFound(_("There is nothing at this address. The operations are listed at /api/schema/."))
        raise NotFound(_("There is nothing at this address. Addresses of the API end with a slash."))


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


def _require_verified_address(racer: Racer) -> None:
    if not EmailAddress.objects.filter(user=racer, verified=True).exists():
        raise AddressUnverified()
