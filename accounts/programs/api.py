"""Programs and their tokens in the API, for admins."""

from typing import Any

from django.core.exceptions import PermissionDenied
from django.db.models import QuerySet
from django.http import Http404
from django.shortcuts import get_object_or_404
from django.utils import timezone
from drf_spectacular.utils import extend_schema_field
from knox.models import AuthToken
from rest_framework import serializers
from rest_framework.request import Request

from core.api.bodies import Body
from core.api.operations import operation
from core.api.views import PrivateView

from ..models import ServiceAccount
from ..request_racer import racer_of
from ..scopes import EVERY, READ, SCOPES
from ..tokens.services import LONGEST_DAYS, tokens_of
from . import services


class ProgramTokenSerializer(serializers.Serializer):
    """A token of a program."""

    key = serializers.CharField(source="token_key", help_text="The letters that it begins with.")
    scopes = serializers.ListField(source="grant.scopes", child=serializers.ChoiceField(SCOPES))
    created_at = serializers.DateTimeField(source="created")
    expires_at = serializers.DateTimeField(source="expiry", allow_null=True)
    last_used_at = serializers.DateTimeField(source="grant.last_used_at", allow_null=True)


class ProgramSerializer(serializers.Serializer):
    """A program's account."""

    alias = serializers.CharField(source="racer.alias")
    purpose = serializers.CharField()
    owner = serializers.CharField(source="owner.alias", default=None, allow_null=True)
    active = serializers.BooleanField(source="racer.is_active")
    made_at = serializers.DateTimeField()
    last_used_at = serializers.DateTimeField(default=None, allow_null=True)


class ProgramDetailSerializer(ProgramSerializer):
    """A program's account with its valid tokens."""

    tokens = serializers.SerializerMethodField()

    @extend_schema_field(ProgramTokenSerializer(many=True))
    def get_tokens(self, program: ServiceAccount) -> Any:
        return ProgramTokenSerializer(tokens_of(program.racer, timezone.now()), many=True).data


class NewProgramTokenSerializer(ProgramTokenSerializer):
    """A new token; its text is answered this once."""

    token = serializers.CharField()


class NewProgramBody(Body):
    """A program."""

    name = serializers.SlugField(max_length=48, help_text="Its alias is `program-` and this name.")
    purpose = serializers.CharField(max_length=200)
    owner = serializers.CharField(max_length=64, help_text="The alias of the responsible racer.")


class ProgramBody(Body):
    """What changes."""

    purpose = serializers.CharField(max_length=200, required=False)
    owner = serializers.CharField(max_length=64, required=False)
    active = serializers.BooleanField(required=False, help_text="false: its tokens are refused.")


class ProgramTokenBody(Body):
    """What a new token may do, and for how long."""

    scopes = serializers.ListField(child=serializers.ChoiceField(SCOPES), default=[READ], allow_empty=False)
    days = serializers.IntegerField(min_value=1, max_value=LONGEST_DAYS, default=30)


class ReplaceTokenBody(Body):
    """How long the new token is valid."""

    days = serializers.IntegerField(min_value=1, max_value=LONGEST_DAYS, default=30)


def _for_admins(request: Request) -> None:
    if not services.can_manage_programs(racer_of(request)):
        raise PermissionDenied


def _program(request: Request, alias: str) -> ServiceAccount:
    _for_admins(request)
    return get_object_or_404(services.programs(), racer__alias__iexact=alias)


def _token(request: Request, alias: str, key: str) -> tuple[ServiceAccount, AuthToken]:
    program = _program(request, alias)
    return program, get_object_or_404(tokens_of(program.racer, timezone.now()), token_key=key)


def _made(made: tuple[AuthToken, str] | None) -> Any:
    if made is None:
        raise Http404
    token: Any = made[0]
    token.token = made[1]
    return token


class ProgramsView(PrivateView):
    token_scope = EVERY

    @operation(
        "list_programs", "Programs' accounts, for admins", find=_for_admins, answer=ProgramSerializer, paged=True
    )
    def get(self, request: Request, _none: None) -> QuerySet[ServiceAccount]:
        return services.programs()

    @operation(
        "create_program",
        "Make a program's account, for admins",
        find=_for_admins,
        body=NewProgramBody,
        answer=ProgramSerializer,
        status=201,
    )
    def post(self, request: Request, _none: None, sent: dict[str, str]) -> ServiceAccount:
        return services.make_program(by=racer_of(request), now=timezone.now(), **sent)


class ProgramView(PrivateView):
    token_scope = EVERY

    @operation("read_program", "A program and its tokens, for admins", find=_program, answer=ProgramDetailSerializer)
    def get(self, request: Request, program: ServiceAccount) -> ServiceAccount:
        return program

    @operation(
        "change_program",
        "Change, disable or enable a program, for admins",
        find=_program,
        body=ProgramBody,
        answer=ProgramDetailSerializer,
    )
    def patch(self, request: Request, program: ServiceAccount, sent: dict[str, Any]) -> ServiceAccount:
        active = sent.pop("active", None)
        if sent:
            services.change_program(program=program, by=racer_of(request), **sent)
        if active is not None:
            services.switch_program(program=program, by=racer_of(request), active=active)
        return program


class ProgramTokensView(PrivateView):
    token_scope = EVERY

    @operation(
        "create_program_token",
        "Make a token for a program, for admins",
        find=_program,
        body=ProgramTokenBody,
        answer=NewProgramTokenSerializer,
        status=201,
    )
    def post(self, request: Request, program: ServiceAccount, sent: dict[str, Any]) -> AuthToken:
        made = services.make_program_token(program=program, by=racer_of(request), now=timezone.now(), **sent)
        return _made(made)


class ProgramTokenView(PrivateView):
    token_scope = EVERY

    @operation(
        "replace_program_token",
        "Replace a token of a program by a new one of the same scopes, for admins",
        find=_token,
        body=ReplaceTokenBody,
        answer=NewProgramTokenSerializer,
        status=201,
    )
    def post(self, request: Request, found: tuple[ServiceAccount, AuthToken], sent: dict[str, int]) -> AuthToken:
        program, token = found
        made = services.replace_program_token(
            program=program, by=racer_of(request), key=token.token_key, now=timezone.now(), **sent
        )
        return _made(made)

    @operation(
        "revoke_program_token", "Revoke a token of a program, for admins", find=_token, answer="It is void from now on."
    )
    def delete(self, request: Request, found: tuple[ServiceAccount, AuthToken]) -> None:
        program, token = found
        services.revoke_program_token(program=program, by=racer_of(request), key=token.token_key)
