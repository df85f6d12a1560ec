"""Queries whose SQL is kept: other values each time, the rows of today."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from datetime import timedelta

import pytest
from django.contrib.sessions.backends.db import SessionStore as DjangosStore
from django.contrib.sessions.models import Session
from django.db import connection
from django.db.models import F, Value
from django.test import Client
from django.utils import timezone

from accounts.models import Racer
from config.serving.sessions import SessionStore
from core.database.kept_queries import KeptQuery
from evaluation.models import Evaluation, State
from tests.factories import a_model, a_racer

pytestmark = pytest.mark.django_db


def test_each_call_binds_its_own_values() -> None:
    racers = [a_racer("alice"), a_racer("bob")]
    found = KeptQuery(lambda pk, alias: Racer.objects.filter(pk=pk, alias=alias))
    assert [found(pk=racer.pk, alias=racer.alias) for racer in racers] == [[racer] for racer in racers]
    assert found(pk=racers[0].pk, alias="bob") == []


def test_a_list_is_bound_by_index() -> None:
    alice, bob = a_racer("alice"), a_racer("bob")
    found = KeptQuery(lambda aliases: Racer.objects.filter(alias__in=[aliases.at(0), aliases.at(1)]))
    assert [set(found(aliases=aliases)) for aliases in (["alice", "bob"], ["bob", ""])] == [{alice, bob}, {bob}]


def test_rows_and_related_rows_are_as_django_reads_them() -> None:
    model = a_model(a_racer("alice"))
    models = type(model).objects.select_related("owner", "network").annotate(of=F("owner__alias"))
    kept, known = KeptQuery(lambda pk: models.filter(pk=pk))(pk=model.pk)[0], models.get(pk=model.pk)
    fields = [field.attname for field in model._meta.concrete_fields]
    assert [getattr(kept, name) for name in fields] == [getattr(known, name) for name in fields]
    assert (kept.of, kept._state.fields_cache.keys()) == ("alice", known._state.fields_cache.keys())


def test_a_time_may_be_one_so_long_before() -> None:
    now = timezone.now()
    racers = {days: a_racer(joined_at=now - timedelta(days=days)) for days in (1, 3, 5)}
    found = KeptQuery(lambda now: Racer.objects.filter(joined_at__gt=now - timedelta(days=1) - timedelta(days=1)))
    assert found(now=now + timedelta(hours=1)) == [racers[1]]
    assert set(found(now=now - timedelta(days=2))) == {racers[1], racers[3]}


def test_a_parameter_with_a_default_may_be_unused() -> None:
    assert KeptQuery(lambda pk, now=None: Racer.objects.filter(pk=pk))(pk=1, now=timezone.now()) == []


def test_constants_are_part_of_the_sql() -> None:
    team = "O'Hara's 100 %s \\ crew"
    racer = a_racer("alice", team=team)
    a_racer("bob")
    sent: list[tuple[str, Sequence[object]]] = []

    def watched(execute: Callable, sql: str, params: Sequence[object], many: bool, context: dict) -> object:
        sent.append((sql, params))
        return execute(sql, params, many, context)

    found = KeptQuery(lambda pk: Racer.objects.filter(pk=pk, team=team))
    with connection.execute_wrapper(watched):
        assert [found(pk=racer.pk), found(pk=racer.pk + 1)] == [[racer], []]
    assert [(sql.count("'O''Hara''s 100 %%s "), params) for sql, params in sent] == [
        (1, (racer.pk,)),
        (1, (racer.pk + 1,)),
    ]
    assert KeptQuery(lambda: Racer.objects.filter(team__startswith=team))() == [racer]


@pytest.mark.skipif(connection.vendor != "sqlite", reason="what SQLite does")
def test_sqlite_prepares_a_query_once() -> None:
    with connection.cursor() as cursor:
        if ("ENABLE_STMTVTAB",) not in cursor.execute("PRAGMA compile_options").fetchall():
            pytest.skip("this SQLite does not list its statements")
        driven = Evaluation.objects.annotate(only_here=Value(1)).filter(state=State.FINISHED)
        runs = KeptQuery(lambda owner: driven.filter(owner=owner))
        for owner in range(5):  # partial indexes name a state, so a parameter would be looked at each time
            assert runs(owner=owner) == []
        cursor.execute("SELECT run, reprep FROM sqlite_stmt WHERE sql LIKE '%only_here%' AND sql NOT LIKE '%reprep%'")
        assert cursor.fetchall() == [(5, 0)]


def test_columns_are_converted() -> None:
    racer = a_racer("alice")
    rows = KeptQuery(lambda pk: Racer.objects.filter(pk=pk).values_list("joined_at", "is_staff"))
    assert rows(pk=racer.pk) == [(racer.joined_at, False)]


def test_a_value_that_the_query_drops_is_a_mistake() -> None:
    with pytest.raises(AssertionError):
        KeptQuery(lambda pk, forgotten: Racer.objects.filter(pk=pk))(pk=1, forgotten=2)


def test_only_the_first_call_compiles(monkeypatch: pytest.MonkeyPatch) -> None:
    found = KeptQuery(lambda pk: Racer.objects.filter(pk=pk))
    found(pk=1)
    monkeypatch.setattr("django.db.models.sql.compiler.SQLCompiler.as_sql", None)
    assert found(pk=2) == []


@pytest.mark.django_db(transaction=True)
def test_threads_share_the_sql_and_not_the_connection() -> None:
    racers = [a_racer(f"racer-{number}") for number in range(4)]
    found = KeptQuery(lambda pk: Racer.objects.filter(pk=pk))

    def read(racer: Racer) -> bool:
        try:
            return all(found(pk=racer.pk) == [racer] for _ in range(50))
        finally:
            connection.close()

    with ThreadPoolExecutor(len(racers)) as threads:
        assert all(threads.map(read, racers))


def test_a_session_ends_with_its_log_out_and_its_date() -> None:
    client = Client()
    for end in (lambda key: client.logout(), lambda key: _expire(key)):
        client.force_login(a_racer())
        key = client.cookies["sessionid"].value
        assert SessionStore(key).load() == DjangosStore(key).load() != {}
        end(key)
        ended = SessionStore(key)
        assert ended.load() == {} and ended.session_key is None


def _expire(key: str) -> None:
    Session.objects.filter(pk=key).update(expire_date=timezone.now())


def test_no_session_key_reads_nothing(django_assert_num_queries: Callable) -> None:
    with django_assert_num_queries(0):
        assert SessionStore().load() == {}
