"""Marks on their way to the grade books of platforms: compared with what was sent, then sent one by one."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from datetime import UTC, datetime, timedelta
from decimal import Decimal
from typing import TYPE_CHECKING, Any
from urllib.parse import urlencode

from django.db import transaction
from django.db.models import Exists, OuterRef, Q, QuerySet, Sum
from django.utils.translation import gettext_lazy as _

from accounts.class_accounts.services import can_teach
from accounts.models import Racer
from core.audit.recording import audited
from core.database.clock import database_now
from core.jobs.heartbeat import Heartbeat
from core.jobs.kinds import register
from core.jobs.retried import RetriedKind
from core.jobs.work import run_next, work_off
from paddock.errors import PaddockError, PlatformFault, UserFault

from ..models import LtiAccount, LtiContext, LtiLine, LtiPlatform, LtiScore, LtiScoreState, Mark
from .services import SCORE

if TYPE_CHECKING:
    from pylti1p3.assignments_grades import AssignmentsGradesService
    from pylti1p3.service_connector import ServiceConnector

    Connectors = dict[int, ServiceConnector | None]  # by platform; None for one that does not answer
LINE = "https://purl.imsglobal.org/spec/lti-ags/scope/lineitem"
OVERLAP = timedelta(minutes=10)  # a mark is written some time after the moment that it bears
TICK = timedelta(milliseconds=1)
LEASE = timedelta(minutes=2)  # longer than the requests of one score
TURN_S = 60.0
_PASSING = (408, 425, 429)


class Scores(RetriedKind[LtiScore]):
    """One score after another; a platform that is away has them wait, a refusal ends one."""

    name, model, task, queue = "LTI score", LtiScore, "courses.tasks.lti_scores", "messages"
    waiting, working, finished = "due", "sending", "sent"
    order, since = ("queued_at", "pk"), "queued_at"
    related = ("line__context__platform", "line__assignment")
    lost_code, gave_up_code = "lease_expired", "platform_gave_up"

    @property
    def lease(self) -> timedelta:
        return LEASE

    def due(self, now: datetime) -> QuerySet[LtiScore]:
        return super().due(now).filter(line__context__platform__is_active=True)


SCORES = register(Scores())


def queue_scores(*, now: datetime) -> int:
    """Make a score due for each complete mark that the platform does not have, of people that it knows. Returns how
    many."""
    newer = Mark.objects.filter(assignment=OuterRef("assignment"), computed_at__gte=OuterRef("looked_at") - OVERLAP)
    lines = LtiLine.objects.filter(Q(looked_at=None) | Exists(newer), context__platform__is_active=True)
    return sum(_queue(line, now) for line in lines.select_related("context", "assignment").order_by("pk"))


@transaction.atomic
def _queue(line: LtiLine, now: datetime) -> int:
    LtiLine.objects.filter(pk=line.pk).update(looked_at=now)
    known = LtiAccount.objects.filter(platform=line.context.platform_id, racer=OuterRef("racer"))
    marks = Mark.objects.filter(Exists(known), assignment=line.assignment, is_complete=True)
    if line.assignment.final_at is None:
        marks = marks.exclude(attempt=None)
    maximum = maximum_of(line)
    sent = {score.racer_id: score for score in line.scores.all()}
    queued = 0
    for racer, points in marks.order_by("pk").values_list("racer", "points"):
        score = sent.get(racer)
        if score is None:
            LtiScore.objects.create(line=line, racer_id=racer, queued_at=now)
            queued += 1
        elif (score.points, score.maximum) != (points, maximum):
            ended = LtiScore.objects.filter(pk=score.pk, state__in=(LtiScoreState.SENT, LtiScoreState.FAILED))
            queued += SCORES.begin_anew(ended, queued_at=now)
    return queued


def maximum_of(line: LtiLine) -> Decimal:
    """All points of the line's assignment."""
    return line.assignment.parts.aggregate(all=Sum("points"))["all"] or Decimal(0)


@audited("lti.scores_resent", _("Marks sent to a learning platform again"), target="line")
def resend(*, line: LtiLine, by: Racer, now: datetime) -> int:
    """Make the failed scores of a line due again. Returns how many. Raises UserFault("class_not_yours")."""
    classroom = getattr(line.context.group, "classroom", None)
    if classroom is None or not can_teach(by, classroom):
        raise UserFault("class_not_yours")
    failed = line.scores.filter(state=LtiScoreState.FAILED)
    count = failed.count()
    SCORES.begin_anew(failed, queued_at=now)
    return count


def send_scores(*, worker: str) -> int:
    """Send what is due, for about a minute; returns how many were tried. One token serves a platform's scores, and one
    that does not answer is not asked again meanwhile."""
    connectors: Connectors = {}

    def send(score: LtiScore, heartbeat: Heartbeat) -> bool:
        try:
            return _send(score, connectors)
        except PlatformFault:
            connectors[score.line.context.platform_id] = None
            raise

    def turn(must_stop: Callable[[], bool]) -> bool:
        return run_next(SCORES, send, worker=worker, interrupted=must_stop)

    return work_off(SCORES, turn, budget_s=TURN_S)


def _send(score: LtiScore, connectors: "Connectors") -> bool:
    from pylti1p3.grade import Grade

    line, mine = score.line, SCORES.held(score.pk, score.lease)
    marks = Mark.objects.filter(assignment=line.assignment_id, racer=score.racer_id, is_complete=True)
    account = LtiAccount.objects.filter(platform=line.context.platform_id, racer=score.racer_id).first()
    mark = marks.first()
    if mark is None or account is None:  # it waits for another run, or the person is gone: nothing to send
        return SCORES.end(mine, state=SCORES.finished, now=database_now())
    maximum, stamp, now = maximum_of(line), score.stamp, database_now()
    is_repeated = stamp is not None and (score.points, score.maximum) == (mark.points, maximum)
    if not is_repeated:
        stamp = now if stamp is None else max(now, stamp + TICK)
    assert stamp is not None
    if not mine.update(points=mark.points, maximum=maximum, stamp=stamp):
        return False
    grade = Grade().set_score_given(float(mark.points)).set_score_maximum(float(maximum))
    grade.set_timestamp(stamp.astimezone(UTC).isoformat(timespec="milliseconds")).set_user_id(account.sub)
    grade.set_activity_progress("Completed").set_grading_progress("FullyGraded")
    with _refusals("lti_refused", unless=409 if is_repeated else None):  # it arrived before
        _service(line, connectors).put_grade(grade)
    ended = SCORES.end(mine, state=SCORES.finished, now=database_now())
    if not marks.filter(points=mark.points).exists():  # it has changed meanwhile
        LtiLine.objects.filter(pk=line.pk).update(looked_at=None)
    return ended


def _service(line: LtiLine, connectors: "Connectors") -> "AssignmentsGradesService":
    """The grade service of a line, with a token of no more than the scope for scores."""
    from pylti1p3.assignments_grades import AssignmentsGradesService

    context = line.context
    if SCORE not in context.scopes:
        raise UserFault("lti_scope")
    connector = _connector(context.platform, connectors)
    with _refusals("lti_token_refused"):
        connector.get_access_token([SCORE])
    if not line.url:
        line.url = _make_line(context, line, connector)
        LtiLine.objects.filter(pk=line.pk).update(url=line.url)
    claim: Any = {"scope": [SCORE], "lineitem": line.url}
    return AssignmentsGradesService(connector, claim)


def _connector(platform: LtiPlatform, connectors: "Connectors") -> "ServiceConnector":
    from pylti1p3.service_connector import ServiceConnector

    from .asking import PlatformSession
    from .library import registration_of

    if platform.pk not in connectors:
        session = PlatformSession()
        connectors[platform.pk] = ServiceConnector(registration_of(platform), session)  # type: ignore[arg-type]
    found = connectors[platform.pk]
    if found is None:
        raise PlatformFault("lti_unreachable", host=platform.name)
    return found


def _make_line(context: LtiContext, line: LtiLine, connector: "ServiceConnector") -> str:
    """The address of the column for this assignment, found or made. Raises UserFault("lti_line")."""
    from pylti1p3.assignments_grades import AssignmentsGradesService
    from pylti1p3.lineitem import LineItem

    if LINE not in context.scopes or not context.lineitems_url:
        raise UserFault("lti_line")
    with _refusals("lti_token_refused"):
        connector.get_access_token([LINE])
    claim: Any = {"scope": [LINE], "lineitems": context.lineitems_url}
    service = AssignmentsGradesService(connector, claim)
    joint = "&" if "?" in context.lineitems_url else "?"
    number = line.assignment.public_id
    with _refusals("lti_line"):
        found, _next = service.get_lineitems_page(f"{context.lineitems_url}{joint}{urlencode({'resource_id': number})}")
        same: list[Any] = [one for one in found if isinstance(one, dict) and one.get("resourceId") == number]
        if not same:
            wanted = LineItem().set_label(line.assignment.title).set_resource_id(number).set_tag("paddock")
            wanted.set_score_maximum(float(maximum_of(line)))
            made = connector.make_service_request(
                [LINE],
                context.lineitems_url,
                is_post=True,
                data=wanted.get_value(),
                content_type="application/vnd.ims.lis.v2.lineitem+json",
                accept="application/vnd.ims.lis.v2.lineitem+json",
            )
            same = [made["body"]]
        address = same[0]["id"]
    if not isinstance(address, str) or not address or len(address) > 500:
        raise UserFault("lti_line")
    return address


@contextmanager
def _refusals(code: str, *, unless: int | None = None) -> Iterator[None]:
    """What a platform answers to a request as a fault: its own troubles are waited for, a refusal has ``code``; an
    answer with the status ``unless`` is none."""
    from pylti1p3.exception import LtiException, LtiServiceException

    try:
        yield
    except LtiServiceException as error:
        status = error.response.status_code
        if status != unless:
            raise _fault(code, status, error.response.url) from error
    except (LtiException, LookupError, TypeError, AttributeError) as error:
        raise UserFault(code, status=200) from error
    except ValueError as error:
        if code != "lti_refused":  # the platform took the score, with an answer that is not JSON
            raise UserFault(code, status=200) from error


def _fault(code: str, status: int, url: str) -> PaddockError:
    if status >= 500 or status in _PASSING:
        return PlatformFault("lti_unreachable", host=url.partition("://")[2].partition("/")[0][:100])
    return UserFault(code, status=status)
