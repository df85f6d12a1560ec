"""Rules that change after marks were computed; places; extensions and refunds; who sees which mark."""

from __future__ import annotations

from decimal import Decimal

import pytest

from core.audit.models import AuditEntry
from courses.assignments.selectors import assignments_taught_by, assignments_visible_to, can_see_assignment, can_teach
from courses.assignments.services import change_assignment, end_extension, extend
from courses.attempts.draws import complete_all_marks
from courses.attempts.selectors import attempts_visible_to, can_see_attempt
from courses.attempts.services import add_reference, refund_attempt
from courses.marks.selectors import marks_visible_to
from courses.marks.services import apply_regrade, propose_regrade
from courses.models import Assignment, Attempt, Mark, Regrade
from paddock.errors import PlatformFault, UserFault
from tests.clients import logged_in
from tests.courses.assignments import DAY, HOUR, a_group, a_part, an_assignment, finish_all, hand_in
from tests.factories import a_model, a_racer, break_down, laps

pytestmark = pytest.mark.django_db

SLOW, FAST = laps(12_000, 12_000, 12_000), laps(9_000, 9_000, 9_000)
BY_TIME = {"pass_rule": "best_lap", "pass_params": {"at_most_ms": 10_000}}


@pytest.fixture(autouse=True)
def _no_broker(wakes) -> None:
    """Attempts send wake-ups; no test here needs a worker to take them."""


@pytest.fixture
def world(alice, now):
    """Two students, one fast and one slow, by the best lap; both are in time."""
    group, (bob, carol) = a_group(alice, 2, now)
    assignment = an_assignment(group, now, parts=[a_part(**BY_TIME)], late_points_a_day=20, last_at=now + 9 * DAY)
    for racer, driven in ((bob, FAST), (carol, SLOW)):
        finish_all(hand_in(assignment, racer, now), driven, now)
    return assignment, bob, carol


def points() -> dict[str, Decimal]:
    return {mark.racer.alias: mark.points for mark in Mark.objects.select_related("racer").order_by("racer")}


def code(call, **options) -> str:
    with pytest.raises(UserFault) as refused:
        call(**options)
    return refused.value.code


def change(assignment: Assignment, now, **fields) -> None:
    change_assignment(assignment=assignment, by=assignment.group.leader, now=now, **fields)


def easier() -> list[dict]:
    return [a_part(**BY_TIME | {"pass_params": {"at_most_ms": 13_000}})]


def test_changed_rules_change_no_mark_until_a_regrade_is_applied(world, alice, now):
    assignment, bob, carol = world
    change(assignment, now, parts=easier())
    before = {bob.alias: 100, carol.alias: 0}
    assert points() == before and assignment.awaits_regrade
    regrade = propose_regrade(assignment=assignment, by=alice, reason="too hard", now=now)
    assert regrade.rows == [{"racer": carol.pk, "old": "0.00", "new": "100.00"}]
    assert points() == before
    apply_regrade(assignment=assignment, regrade=regrade, by=alice, now=now)
    assert points() == {bob.alias: 100, carol.alias: 100} and not Assignment.objects.get().awaits_regrade
    assert {mark.rules_version for mark in Mark.objects.all()} == {2}


def test_new_attempts_are_marked_by_the_rules_of_the_marks_that_stand(world, alice, now):
    assignment, _bob, carol = world
    change(assignment, now, parts=easier())
    finish_all(hand_in(assignment, carol, now), laps(12_500, 12_500, 12_500), now)
    assert points()[carol.alias] == 0
    regrade = propose_regrade(assignment=assignment, by=alice, reason="too hard", now=now)
    assert [row["racer"] for row in regrade.rows] == [carol.pk]


def test_a_change_that_changes_no_mark_needs_no_regrade(world, alice, now):
    assignment, *_students = world
    change(assignment, now, late_points_a_day=5, title="Renamed")
    assert (assignment.rules_version, assignment.awaits_regrade) == (2, False)
    assert code(propose_regrade, assignment=assignment, by=alice, reason="x", now=now) == "regrade_done_already"


def test_points_that_move_between_parts_need_a_regrade(alice, now):
    group, (bob,) = a_group(alice, 1, now)
    parts = [a_part(**BY_TIME | {"points": 60}), a_part(**BY_TIME | {"points": 40})]
    assignment = an_assignment(group, now, parts=parts)
    finish_all(hand_in(assignment, bob, now), FAST, now)
    change(assignment, now, parts=parts[::-1])
    assert assignment.awaits_regrade and [part["points"] for part in Mark.objects.get().parts] == ["60.00", "40.00"]
    regrade = propose_regrade(assignment=assignment, by=alice, reason="swapped", now=now)
    assert regrade.rows == [{"racer": bob.pk, "old": "100.00", "new": "100.00"}]
    apply_regrade(assignment=assignment, regrade=regrade, by=alice, now=now)
    assert [part["points"] for part in Mark.objects.get().parts] == ["40.00", "60.00"]


def test_a_regrade_is_applied_as_it_was_shown_or_not_at_all(world, alice, now):
    assignment, _bob, carol = world
    change(assignment, now, parts=easier())
    regrade = propose_regrade(assignment=assignment, by=alice, reason="too hard", now=now)
    finish_all(hand_in(assignment, carol, now), FAST, now)
    assert code(apply_regrade, assignment=assignment, regrade=regrade, by=alice, now=now) == "regrade_changed"
    change(assignment, now, parts=[a_part(**BY_TIME | {"points": 50})])
    latest = propose_regrade(assignment=assignment, by=alice, reason="half", now=now)
    apply_regrade(assignment=assignment, regrade=latest, by=alice, now=now)
    assert set(points().values()) == {50}
    assert code(apply_regrade, assignment=assignment, regrade=latest, by=alice, now=now) == "regrade_changed"


def test_the_audit_log_has_what_teachers_did(world, alice, now):
    assignment, bob, _carol = world
    client, below = logged_in(alice), f"/api/v1/assignments/{assignment.public_id}/"
    attempt = Attempt.objects.earliest("pk").public_id
    part = {"title": "Laps", "points": 50, "pass_rule": "laps_in_row", "rules": {"laps": 5}}
    writes = [
        ("patch", below, {"parts": [part | {"tracks": [{"track": "oval"}]}]}),
        ("post", f"{below}regrades/", {"reason": "half"}),
        ("post", f"{below}regrades/{{regrade}}/application/", {}),
        ("post", f"{below}extensions/", {"racer": bob.alias, "due_at": (now + 3 * DAY).isoformat(), "reason": "ill"}),
        ("delete", f"{below}extensions/{bob.alias}/", {}),
        ("post", f"/api/v1/attempts/{attempt}/refund/", {"reason": "a broken track"}),
    ]
    for method, address, sent in writes:
        regrade = Regrade.objects.order_by("pk").last()
        address = address.format(regrade=regrade and regrade.pk)
        answer = getattr(client, method)(address, sent, content_type="application/json")
        assert answer.status_code < 300, answer.content
    acts = list(AuditEntry.objects.filter(actor=alice.pk).order_by("pk").values_list("action", flat=True))
    assert acts == [
        *("assignment.changed", "assignment.regrade_proposed", "assignment.regraded"),
        *("assignment.extended", "assignment.extension_ended", "attempt.refunded"),
    ]


def test_an_extension_and_its_end_move_late_days(world, alice, now):
    assignment, bob, _carol = world
    late = assignment.due_at + HOUR
    finish_all(refund_and_repeat(assignment, bob, alice, late), FAST, late)
    assert Mark.objects.get(racer=bob).points == 80
    extend(assignment=assignment, racer=bob, by=alice, due_at=late, last_at=None, reason="ill", now=late)
    assert Mark.objects.get(racer=bob).points == 100
    end_extension(assignment=assignment, racer=bob, by=alice, now=late)
    assert Mark.objects.get(racer=bob).points == 80


def refund_and_repeat(assignment, racer, teacher, now) -> Attempt:
    refund_attempt(attempt=Attempt.objects.get(racer=racer), by=teacher, reason="a broken track", now=now)
    return hand_in(assignment, racer, now)


def test_a_fault_of_the_site_after_the_deadline_gives_a_day(alice, now):
    group, (bob, carol) = a_group(alice, 2, now)
    assignment = an_assignment(group, now)
    attempt = hand_in(assignment, bob, assignment.due_at)
    ended = assignment.due_at + HOUR
    break_down(attempt.runs.get().evaluation, PlatformFault("runner_died"), ended)
    finish_all(hand_in(assignment, bob, ended + DAY), FAST, ended + DAY)
    mark = Mark.objects.get(racer=bob)
    assert (mark.points, mark.late_days) == (100, 0)
    assert code(hand_in, assignment=assignment, racer=carol, now=ended) == "attempt_too_late"


def test_places_are_given_when_the_last_run_is_over(alice, now):
    group, (bob, carol, dave) = a_group(alice, 3, now)
    by_place = {"pass_rule": "place", "pass_params": {"place": 1, "by": "best"}}
    assignment = an_assignment(group, now, parts=[a_part(**by_place)])
    add_reference(assignment=assignment, by=alice, label="Teacher", model=a_model(alice), now=now)
    finish_all(Attempt.objects.get(is_reference=True), laps(7_000, 7_000, 7_000), now)
    first, second = hand_in(assignment, bob, now), hand_in(assignment, carol, now)
    finish_all(first, SLOW, now)
    over = assignment.due_at + HOUR
    assert complete_all_marks(now=over) == 0, "a run waits"
    finish_all(second, FAST, over)
    assert {mark.is_complete for mark in Mark.objects.all()} == {False}
    assert (complete_all_marks(now=over), complete_all_marks(now=over)) == (1, 0)
    assert points() == {bob.alias: 0, carol.alias: 100, dave.alias: 0}
    assert all(mark.is_complete for mark in Mark.objects.all())
    refund_attempt(attempt=second, by=alice, reason="a shared car", now=over)
    assert complete_all_marks(now=over) == 1
    assert points() == {bob.alias: 100, carol.alias: 0, dave.alias: 0}


def test_each_permission_has_its_queryset_twin(world, alice, now):
    assignment, bob, carol = world
    draft = an_assignment(assignment.group, now, publish=False, title="Draft")
    other_group, (dave,) = a_group(a_racer("other"), 1, now, "Other")
    other = an_assignment(other_group, now, title="Other")
    hand_in(other, dave, now)
    add_reference(assignment=assignment, by=alice, label="Teacher", model=a_model(alice), now=now)
    admin = a_racer("admin", is_staff=True)
    for viewer in (alice, bob, carol, dave, admin, other_group.leader, None):
        for one in (assignment, draft, other):
            seen = assignments_visible_to(viewer).filter(pk=one.pk)
            assert seen.count() == can_see_assignment(viewer, one), (viewer, one)
            assert assignments_taught_by(viewer).filter(pk=one.pk).count() == can_teach(viewer, one)
        for one in Attempt.objects.all():
            assert attempts_visible_to(viewer).filter(pk=one.pk).count() == can_see_attempt(viewer, one)
        for one in Mark.objects.all():
            own = one.racer == viewer and can_see_assignment(viewer, one.assignment)
            assert marks_visible_to(viewer).filter(pk=one.pk).count() == (own or can_teach(viewer, one.assignment))
    assert not assignments_visible_to(admin).exists(), "names of students are their teachers' to see"
    assert [can_see_assignment(bob, one) for one in (assignment, draft, other)] == [True, False, False]
