"""The cast of assignments: each predicate with its queryset twin, and every page as each of them."""

from __future__ import annotations

from collections.abc import Callable
from datetime import datetime
from typing import Any

import pytest
from django.core.cache import cache

from accounts.class_accounts.services import add_learners, add_teacher, make_class
from courses.assignments.selectors import (
    assignments_taught_by,
    assignments_visible_to,
    can_see_assignment,
    can_teach,
)
from courses.attempts.overview import handed_in_by
from courses.attempts.selectors import attempts_visible_to, can_see_attempt
from courses.grading.members import can_teach_group, groups_taught_by, is_student, students_of
from courses.marks.selectors import marks_visible_to
from courses.models import Mark
from tests.clients import logged_in
from tests.courses.assignments import an_assignment, finish_all, hand_in
from tests.factories import a_racer, laps
from tests.kept import Kept

pytestmark = pytest.mark.django_db
# role: teaches, is a student, sees the draft, the published one, Kim's attempt and mark
ROLES = {
    "teacher": (True, False, True, True, True),
    "second": (True, False, True, True, True),
    "kim": (False, True, False, True, True),
    "ann": (False, True, False, True, False),
    "other": (False, False, False, False, False),
    "stranger": (False, False, False, False, False),
    "staff": (False, False, False, False, False),
    "nobody": (False, False, False, False, False),
}


@pytest.fixture(scope="session")
def kept_classes(request: pytest.FixtureRequest, keep: Callable, now: datetime) -> Kept:
    return keep(request, lambda: _classes(now))


@pytest.fixture
def cast(kept_classes: Kept, db: None, wakes: list[dict]) -> dict[str, Any]:
    cache.clear()
    return kept_classes.copy()


def _classes(now: datetime) -> dict[str, Any]:
    """Alice and Bob teach a class; Charlie's class has another student."""
    alice, bob, charlie = (a_racer(name) for name in ("alice", "bob", "charlie"))
    room = make_class(teacher=alice, name="6a", plan=[], now=now)
    kim, ann = add_learners(classroom=room, by=alice, names=["Kim Minji", "Ann Lee"], now=now)
    elsewhere = make_class(teacher=charlie, name="6b", plan=[], now=now)
    (other,) = add_learners(classroom=elsewhere, by=charlie, names=["Lou"], now=now)
    add_teacher(classroom=room, by=alice, alias="bob", now=now)
    made = an_assignment(room.group, now)
    attempt = hand_in(made, kim.learner.racer, now)
    finish_all(attempt, laps(*[9_000] * 5), now)
    return {
        "group": room.group,
        "made": made,
        "draft": an_assignment(room.group, now, publish=False, title="Draft"),
        "attempt": attempt,
        "mark": Mark.objects.get(racer=kim.learner.racer),
        "teacher": alice,
        "second": bob,
        "kim": kim.learner.racer,
        "ann": ann.learner.racer,
        "other": other.learner.racer,
        "stranger": a_racer(),
        "staff": a_racer(is_staff=True, is_superuser=True),
        "nobody": None,
    }


@pytest.mark.parametrize("role", ROLES)
def test_each_predicate_agrees_with_its_queryset(cast, role):
    viewer, (teaches, student, draft, published, attempt) = cast[role], ROLES[role]

    def both(said: bool, rows, row) -> bool:
        assert rows.filter(pk=row.pk).exists() is said
        return said

    group, made, unpublished = cast["group"], cast["made"], cast["draft"]
    assert both(can_teach_group(viewer, group), groups_taught_by(viewer), group) is teaches
    assert both(can_teach(viewer, made), assignments_taught_by(viewer), made) is teaches
    assert is_student(viewer, group) is student
    if viewer is not None:
        assert both(is_student(viewer, group), students_of(group), viewer) is student
        assert handed_in_by(viewer).filter(pk=made.pk).exists() is student
        assert not handed_in_by(viewer).filter(pk=unpublished.pk).exists()
    assert both(can_see_assignment(viewer, made), assignments_visible_to(viewer), made) is published
    assert both(can_see_assignment(viewer, unpublished), assignments_visible_to(viewer), unpublished) is draft
    assert both(can_see_attempt(viewer, cast["attempt"]), attempts_visible_to(viewer), cast["attempt"]) is attempt
    assert marks_visible_to(viewer).filter(pk=cast["mark"].pk).exists() is attempt


@pytest.mark.parametrize("role", [role for role in ROLES if role != "nobody"])
def test_every_page_answers_the_cast(cast, role):
    teaches, _student, draft, published, attempt = ROLES[role]
    client, made = logged_in(cast[role]), cast["made"]
    for page in ("edit/", "parts/1/", "exceptions/", "marks/", "marks.csv", "regrade/", "log/"):
        assert (client.get(f"/assignments/{made.public_id}/{page}").status_code == 200) is teaches, page
    assert (client.get(made.get_absolute_url()).status_code == 200) is published
    assert (client.get(cast["draft"].get_absolute_url()).status_code == 200) is draft
    assert (client.get(cast["attempt"].get_absolute_url()).status_code == 200) is attempt
    refund = client.post(f"{cast['attempt'].get_absolute_url()}refund/", {"reason": "x"})
    cast["attempt"].refresh_from_db()
    assert (refund.status_code == 302) is teaches and (cast["attempt"].refunded_at is not None) is teaches


def test_no_page_of_a_student_has_names_of_others_or_candidates(cast, now):
    """Real names are the teachers'; a board without names has no alias of another student."""
    made, kim, ann = cast["made"], cast["kim"], cast["ann"]
    for shows, alias in (("own", False), ("anonymous", False), ("named", True)):
        type(made).objects.filter(pk=made.pk).update(shows=shows)
        cache.clear()
        page = logged_in(ann).get(made.get_absolute_url()).content.decode()
        assert (kim.alias in page) is alias and "Minji" not in page, shows
        assert ("a student" in page) is (shows == "anonymous")
