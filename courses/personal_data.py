"""Personal data of courses: attempts and marks go with the account."""

from core.personal_data.rules import NOBODY, OTHERS, SECRET, Leaving, PersonalData, register
from evaluation.models import Evaluation

from .models import (
    Assignment,
    AssignmentPart,
    Attempt,
    AttemptRun,
    Extension,
    LtiAccount,
    LtiContext,
    LtiLine,
    LtiPlatform,
    LtiScore,
    Mark,
    ReferenceRow,
    Regrade,
    SubmissionGroup,
    SubmissionGroupMember,
)

_OF_THE_GROUP = "It belongs to the assignment and to all its students."


def _erase(leaving: Leaving) -> None:
    """Attempts of a submission group go to one of its other members."""
    for attempt in Attempt.objects.filter(racer=leaving.racer, submission_group__isnull=False):
        others = SubmissionGroupMember.objects.filter(group=attempt.submission_group_id).exclude(racer=leaving.racer)
        other = others.order_by("pk").first()
        if other is not None:
            Attempt.objects.filter(pk=attempt.pk).update(racer=other.racer_id, model_name="")
            Evaluation.with_sealed.filter(attempt_run__attempt=attempt).update(owner=other.racer_id)
    for regrade in Regrade.objects.filter(assignment__marks__racer=leaving.racer).distinct():
        rows = [row for row in regrade.rows if row["racer"] != leaving.racer.pk]
        Regrade.objects.filter(pk=regrade.pk).update(rows=rows)


register(
    "courses",
    PersonalData(
        Mark,
        owner="racer",
        rows=True,
        section="marks",
        exported="parts",
    ),
    PersonalData(
        AttemptRun,
        owner="attempt__racer",
        rows=True,
        section="attempt_runs",
        exported="laps",
    ),
    PersonalData(
        Attempt,
        owner="racer",
        rows=True,
        erased="refunded_by",
        section="attempts",
        exported="model_name refund_reason",
        withheld={OTHERS: "refunded_by"},
    ),
    PersonalData(
        Extension,
        owner="racer",
        rows=True,
        erased="granted_by",
        section="extensions",
        exported="reason",
        withheld={OTHERS: "granted_by"},
    ),
    PersonalData(SubmissionGroupMember, owner="racer", rows=True, section="submission_groups"),
    PersonalData(SubmissionGroup, kept={_OF_THE_GROUP: "name"}, mentions="name"),
    PersonalData(ReferenceRow, kept={_OF_THE_GROUP: "label"}, mentions="label"),
    PersonalData(Regrade, erased="asked_by applied_by", kept={_OF_THE_GROUP: "reason rows"}, mentions="reason"),
    PersonalData(AssignmentPart, kept={_OF_THE_GROUP: "title pass_params rules"}),
    PersonalData(
        Assignment,
        owner="created_by",
        erased="created_by",
        kept={_OF_THE_GROUP: "title instructions time_zone draw_seed marked_rules"},
        section="assignments",
        exported="title instructions time_zone marked_rules",
        withheld={SECRET: "draw_seed"},
    ),
    PersonalData(LtiAccount, owner="racer", rows=True, section="learning_platforms", exported="sub"),
    PersonalData(
        LtiScore,
        owner="racer",
        rows=True,
        section="sent_marks",
        exported="reason_code",
        withheld={"They are notes for operators.": "operator_detail", "They name a server.": "reason_params"},
    ),
    PersonalData(LtiContext, kept={_OF_THE_GROUP: "title lineitems_url scopes"}),
    PersonalData(LtiLine, kept={_OF_THE_GROUP: "url"}),
    PersonalData(LtiPlatform, kept={NOBODY: "name deployments authorize_url token_url jwks_url"}),
    erase=_erase,
)
