"""Who may see an event: the predicate and its twin say the same of the whole cast."""

from __future__ import annotations

import pytest
from django.contrib.auth.models import AnonymousUser

from core.events import Event, EventKind, can_see_event, events_visible_to, record, register

pytestmark = pytest.mark.django_db


def test_only_the_racer_and_staff_see_a_personal_event(alice, bob, now):
    mine = register(EventKind("test.mine", "something of one's own", "own", names=("racer",)))
    record(mine, at=now, racer=alice.pk)
    event, admin = Event.objects.get(), type(alice).objects.create_superuser("root", "root@example.org", None)
    for viewer, sees in ((alice, True), (bob, False), (admin, True), (AnonymousUser(), False), (None, False)):
        assert can_see_event(viewer, event) == sees == (event in events_visible_to(viewer)), viewer


def test_only_staff_see_events_of_a_removed_kind(alice, now):
    Event.objects.create(kind="test.forgotten", at=now, racer=alice)
    assert not can_see_event(alice, Event.objects.get()) and not events_visible_to(alice).exists()
    alice.is_staff = True
    assert can_see_event(alice, Event.objects.get()) and events_visible_to(alice).exists()
