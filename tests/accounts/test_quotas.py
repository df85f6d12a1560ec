"""What a racer may use: the site's limits, an admin's for one racer, and who sees how much is used."""

from __future__ import annotations

from datetime import UTC, datetime

import pytest
from django.db import IntegrityError, connection, transaction
from django.test.utils import CaptureQueriesContext
from django.urls import reverse

from accounts.models import MOST, Racer, RacerQuota
from accounts.quotas import all_quotas, limit_of, used_by
from accounts.usage.selectors import racers_by_use, usage_of, usage_rows
from paddock.errors import UserFault
from races.pages.services import create_community_race
from tests.factories import a_model, a_race, a_racer, a_track
from tests.kept_parts import parts_are_kept
from tracks.models import Track

pytestmark = pytest.mark.django_db
NOW = datetime(2026, 5, 6, 12, tzinfo=UTC)
OWN = [
    "own_runs_at_once",
    "own_runs_a_day",
    "invited_a_day",
    "reports_at_once",
    "reports_a_day",
    "learners",
    "assignments",
    "reports",
    "followed",
]
ON = "models storage_mb tracks races trainings_at_once training_minutes videos_at_once videos_a_day " + " ".join(OWN)


@pytest.fixture(autouse=True)
def _everything_on(settings) -> None:
    settings.TRAINING = settings.VIDEOS = True


@pytest.fixture
def boss(client) -> Racer:
    """A superuser who is logged in."""
    racer = Racer.objects.create_superuser("boss", "boss@example.org", None)
    client.force_login(racer)
    return racer


def test_every_limit_in_the_settings_is_a_quota() -> None:
    assert " ".join(quota.name for quota in all_quotas()) == ON


def test_disabled_features_show_no_quota(settings) -> None:
    settings.TRAINING = settings.VIDEOS = False
    assert [quota.name for quota in all_quotas()] == ["models", "storage_mb", "tracks", "races", *OWN]


def test_the_sites_limit_applies_until_an_admin_sets_another(settings) -> None:
    settings.MODELS_PER_RACER = 7
    alice, bob = a_racer("alice"), a_racer("bob")
    RacerQuota.objects.create(racer=alice, name="models", limit=9)
    assert (limit_of(alice, "models"), limit_of(bob, "models")) == (9, 7)


def test_usage_is_counted_per_racer() -> None:
    alice, bob = a_racer("alice"), a_racer("bob")
    a_model(alice), a_model(alice), a_model(bob)
    a_race(NOW, organiser=alice)
    a_race(NOW, organiser=alice, cancelled_at=NOW)
    Track.objects.filter(pk=a_track().pk).update(owner=bob)
    assert [used_by(alice, name, NOW) for name in ("models", "races", "tracks")] == [2, 1, 0]
    assert [used_by(bob, name, NOW) for name in ("models", "races", "tracks")] == [1, 0, 1]


def test_a_racers_own_limit_is_enforced(settings) -> None:
    settings.RACES_PER_RACER = 1
    alice, bob = a_racer("alice"), a_racer("bob")
    RacerQuota.objects.create(racer=alice, name="races", limit=2)
    RacerQuota.objects.create(racer=bob, name="races", limit=0)

    def hold(racer: Racer, name: str) -> None:
        week = {"opens_at": NOW, "closes_at": NOW.replace(day=13)}
        create_community_race(organiser=racer, now=NOW, name=name, track=a_track(), **week)

    hold(alice, "One")
    hold(alice, "Two")
    for racer, limit in ((alice, 2), (bob, 0)):
        with pytest.raises(UserFault) as refused:
            hold(racer, "Another")
        assert (refused.value.code, refused.value.params) == ("race_limit", {"limit": limit})


@pytest.mark.parametrize(("name", "limit"), [("models", -1), ("models", MOST + 1)])
def test_the_database_refuses_an_out_of_range_limit(name: str, limit: int) -> None:
    alice = a_racer("alice")
    with pytest.raises(IntegrityError), transaction.atomic():
        RacerQuota.objects.create(racer=alice, name=name, limit=limit)


def test_a_racer_has_one_limit_per_kind() -> None:
    alice = a_racer("alice")
    RacerQuota.objects.create(racer=alice, name="models", limit=1)
    with pytest.raises(IntegrityError), transaction.atomic():
        RacerQuota.objects.create(racer=alice, name="models", limit=2)


def test_an_admin_sets_a_limit_on_the_racers_page(client, boss) -> None:
    alice = a_racer("alice")
    page = reverse("admin:accounts_racer_change", args=[alice.pk])
    form = {"email": alice.email, "country": "", "is_active": "on"}
    for prefix in ("emailaddress_set", "authenticator_set", "quotas"):
        form |= {f"{prefix}-TOTAL_FORMS": "0", f"{prefix}-INITIAL_FORMS": "0"}
    form |= {"quotas-TOTAL_FORMS": "1", "quotas-0-name": "training_minutes", "quotas-0-limit": "60"}
    assert client.post(page, form).status_code == 302
    assert limit_of(alice, "training_minutes") == 60
    refused = client.post(page, form | {"quotas-0-name": "nonsense"})
    assert refused.status_code == 200 and "nonsense is not one of the available choices" in refused.content.decode()


def test_the_racers_page_and_the_api_agree(client) -> None:
    alice = a_racer("alice")
    a_model(alice)
    RacerQuota.objects.create(racer=alice, name="models", limit=4)
    client.force_login(alice, backend="django.contrib.auth.backends.ModelBackend")
    page = client.get("/settings/usage/").content.decode()
    assert "Models in the garage" in page and "personal limit" in page
    answer = client.get("/api/v1/me/usage/").json()
    assert answer[0] == {"name": "models", "label": "Models in the garage", "used": 1.0, "limit": 4, "own": True}
    assert [row["name"] for row in answer] == ON.split()


def test_only_admins_see_the_usage_of_all_racers(client, boss) -> None:
    alice = a_racer("alice")
    a_model(alice), a_model(a_racer("bob")), a_model(alice)
    page = client.get("/usage/?by=models").content.decode()
    assert page.index(">alice<") < page.index(">bob<")
    assert client.get("/usage/?by=nonsense&page=99").status_code == 200
    client.force_login(alice, backend="django.contrib.auth.backends.ModelBackend")
    assert client.get("/usage/").status_code == 403
    client.logout()
    assert client.get("/usage/").status_code == 302


def test_admins_share_a_table_of_usage_but_no_permission(client, boss, django_assert_max_num_queries) -> None:
    alice = a_racer("alice")
    a_model(alice)
    looks_on = a_racer("looks-on", is_staff=True)
    admin_page = reverse("admin:accounts_racer_change", args=[alice.pk])
    with parts_are_kept():
        for racer in (boss, looks_on, boss, looks_on):
            client.force_login(racer, backend="django.contrib.auth.backends.ModelBackend")
            page = client.get("/usage/?by=models").content.decode()
            assert (f'href="{admin_page}"' in page) == (racer == boss)
            assert (f'href="{alice.get_absolute_url()}"' in page) == (racer == looks_on)
        client.force_login(boss, backend="django.contrib.auth.backends.ModelBackend")
        with django_assert_max_num_queries(4):
            client.get("/usage/?by=models")


def test_more_racers_need_no_more_queries(django_assert_num_queries) -> None:
    racers = [a_racer(f"racer-{n}") for n in range(5)]
    for racer in racers:
        a_model(racer)
    assert racers_by_use(all_quotas()[0], NOW) == [racer.pk for racer in racers]
    with CaptureQueriesContext(connection) as of_one:
        usage_rows(racers[:1], NOW)
    with django_assert_num_queries(len(of_one)):
        rows = usage_rows(racers, NOW)
    assert [row.usage for row in rows] == [usage_of(racer, NOW) for racer in racers]


def test_each_kind_of_files_is_one_query(django_assert_max_num_queries) -> None:
    """Networks, uploads, traces, videos, trainings and pictures, each with all its columns."""
    alice = a_racer("alice")
    a_model(alice)
    with django_assert_max_num_queries(6):
        assert used_by(alice, "storage_mb", NOW) > 0


def test_the_usage_of_all_racers_needs_few_queries_for_a_quota(client, boss) -> None:
    """Two for each quota that is no sum of files, and one for each kind of files."""
    a_model(a_racer("alice"))
    with CaptureQueriesContext(connection) as sent:
        client.get("/usage/?by=models")
    print(len(sent))
    assert len(sent) <= 18
