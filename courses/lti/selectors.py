"""What the teachers of a class see of its platforms."""

from django.db.models import Count, Max, Prefetch, Q, QuerySet

from accounts.models import Classroom

from ..models import LtiLine, LtiScore, LtiScoreState


def lines_of(classroom: Classroom) -> QuerySet[LtiLine]:
    """The columns in grade books for the class's assignments, with numbers of ``sent``, ``due`` and ``failed`` scores
    and ``failures``, the failed ones with their reasons."""
    lines = LtiLine.objects.filter(context__group=classroom.group_id).select_related(
        "assignment", "context__platform", "context__group__classroom"
    )
    failed = LtiScore.objects.filter(state=LtiScoreState.FAILED).select_related("racer__learner")
    counts = {
        "sent": Count("scores", filter=Q(scores__state=LtiScoreState.SENT)),
        "due": Count("scores", filter=Q(scores__state__in=(LtiScoreState.DUE, LtiScoreState.SENDING))),
        "failed": Count("scores", filter=Q(scores__state=LtiScoreState.FAILED)),
        "sent_at": Max("scores__ended_at", filter=Q(scores__state=LtiScoreState.SENT)),
    }
    return lines.annotate(**counts).prefetch_related(Prefetch("scores", failed, to_attr="failures")).order_by("pk")
