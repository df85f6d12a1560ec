"""Following racers: who may, who sees it, how many, and accounts of classes."""

from __future__ import annotations

import pytest
from django.contrib.auth.models import AnonymousUser
from django.db import IntegrityError, transaction

from accounts.class_accounts.services import add_learners, make_class
from accounts.following import (
    COUNTED,
    can_follow,
    follow_racer,
    followed_by,
    followers_of,
    followers_shown,
    follows_visible_to,
    unfollow_racer,
)
from accounts.models import Follow, Racer, RacerQuota
from paddock.errors import UserFault
from tests.factories import a_racer

pytestmark = pytest.mark.django_db


def refused(**asked) -> str:
    with pytest.raises(UserFault) as fault:
        follow_racer(**asked)
    assert not Follow.objects.filter(follower=asked["follower"], followed=asked["racer"]).exists()
    return fault.value.code


def test_following_is_done_once_and_undone(alice, bob, now):
    first = follow_racer(follower=alice, racer=bob, now=now)
    assert follow_racer(follower=alice, racer=bob, now=now).pk == first.pk
    assert [one.followed for one in followed_by(alice)] == [bob] and followers_of(bob.pk) == [alice.pk]
    unfollow_racer(follower=alice, racer=bob)
    unfollow_racer(follower=alice, racer=bob)
    assert not Follow.objects.exists()
    with pytest.raises(IntegrityError), transaction.atomic():
        Follow.objects.create(follower=alice, followed=alice, since=now)


def test_nobody_follows_themselves_a_house_car_or_a_closed_account(alice, bob, now):
    house, closed = a_racer(is_house=True), a_racer(is_active=False)
    for racer in (alice, house, closed):
        assert refused(follower=alice, racer=racer, now=now) == "follow_not_this"
    assert refused(follower=closed, racer=bob, now=now) == "follow_not_this"


def test_there_is_a_quota(alice, bob, charlie, now):
    RacerQuota.objects.create(racer=alice, name="followed", limit=1)
    follow_racer(follower=alice, racer=bob, now=now)
    follow_racer(follower=alice, racer=bob, now=now)
    assert refused(follower=alice, racer=charlie, now=now) == "follow_too_many"
    unfollow_racer(follower=alice, racer=bob)
    follow_racer(follower=alice, racer=charlie, now=now)


def test_who_follows_and_admins_see_it_and_nobody_else(alice, bob, charlie, now):
    admin = a_racer(is_staff=True)
    follow = follow_racer(follower=alice, racer=bob, now=now)
    cast = ((None, False), (AnonymousUser(), False), (charlie, False), (bob, False), (alice, True), (admin, True))
    for viewer, sees in cast:
        assert follows_visible_to(viewer).filter(pk=follow.pk).exists() is sees
    assert not followed_by(admin).exists()  # who sees a thing has not done it


def test_who_is_in_a_class_follows_and_is_followed_within_it_alone(alice, bob, charlie, now):
    mine = make_class(teacher=alice, name="7c", plan=[], now=now)
    first, second = (card.learner.racer for card in add_learners(classroom=mine, by=alice, names=["A", "B"], now=now))
    other = make_class(teacher=bob, name="6a", plan=[], now=now)
    (third,) = (card.learner.racer for card in add_learners(classroom=other, by=bob, names=["C"], now=now))
    admin, closed, house = a_racer(is_staff=True), a_racer(is_active=False), a_racer(is_house=True)
    everybody = [alice, bob, charlie, first, second, third, admin, closed, house]
    may = {(viewer.pk, racer.pk) for viewer in everybody for racer in everybody if can_follow(viewer, racer)}
    assert not can_follow(None, bob) and not can_follow(AnonymousUser(), bob)
    assert {racer for who, racer in may if who == first.pk} == {second.pk, alice.pk}
    assert {who for who, racer in may if racer == first.pk} == {second.pk, alice.pk}
    assert {who for who, racer in may if racer == third.pk} == {bob.pk}
    assert refused(follower=charlie, racer=first, now=now) == "follow_not_this"
    assert refused(follower=first, racer=charlie, now=now) == "follow_not_this"


def test_closed_accounts_are_not_listed_counted_or_told(alice, bob, now):
    follow_racer(follower=alice, racer=bob, now=now)
    Racer.objects.filter(pk=bob.pk).update(is_active=False)
    assert not followed_by(alice).exists() and not followers_of(bob.pk)
    Racer.objects.filter(pk=bob.pk).update(is_active=True)
    Racer.objects.filter(pk=alice.pk).update(is_active=False)
    assert followers_shown(bob, bob) == "" and not followers_of(bob.pk)


def test_strangers_are_told_no_number_beyond_a_bound(alice, bob, charlie, now):
    assert followers_shown(None, bob) == ""
    for _ in range(COUNTED):
        Follow.objects.create(follower=a_racer(), followed=bob, since=now)
    assert followers_shown(None, bob) == str(COUNTED)
    Follow.objects.create(follower=charlie, followed=bob, since=now)
    assert followers_shown(None, bob) == followers_shown(alice, bob) == f"{COUNTED}+"
    assert followers_shown(bob, bob) == followers_shown(a_racer(is_staff=True), bob) == str(COUNTED + 1)
