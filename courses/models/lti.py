"""Learning platforms by LTI 1.3: their courses, the accounts of their people, and scores that are sent to them."""

from django.conf import settings
from django.db import models
from django.db.models import Q
from django.utils import timezone
from django.utils.translation import gettext_lazy as _

from core.database.columns import OneLineField
from core.jobs.models import Job, lease_constraints

LONGEST_ID = 255  # of LTI 1.3


class LtiPlatform(models.Model):
    """A learning platform that an admin has registered. ``deployments``: the ids that are accepted."""

    name = OneLineField(_("name"), max_length=64)
    issuer = models.CharField(_("issuer"), max_length=255)
    client_id = models.CharField(_("client ID"), max_length=255)
    deployments = models.JSONField(_("deployment IDs"), default=list)
    authorize_url = models.CharField(_("authentication URL"), max_length=500)
    token_url = models.CharField(_("token URL"), max_length=500)
    jwks_url = models.CharField(_("key set URL"), max_length=500)
    audience = models.CharField(_("audience of tokens"), max_length=500, blank=True)
    is_active = models.BooleanField(_("active"), default=True)
    added_at = models.DateTimeField(_("added"), default=timezone.now, editable=False)

    class Meta:
        verbose_name = _("learning platform")
        verbose_name_plural = _("learning platforms")
        ordering = ["name", "pk"]
        constraints = [models.UniqueConstraint(fields=["issuer", "client_id"], name="lti_platform_once")]

    def __str__(self) -> str:
        return self.name


class LtiContext(models.Model):
    """A course of a platform and the class that its people come to. ``lineitems_url`` and ``scopes``: the service for
    marks, as the newest launch has named it."""

    platform = models.ForeignKey(
        LtiPlatform, models.CASCADE, related_name="contexts", verbose_name=_("learning platform")
    )
    deployment_id = models.CharField(_("deployment ID"), max_length=LONGEST_ID)
    context_id = models.CharField(_("course ID"), max_length=LONGEST_ID)
    title = OneLineField(_("title"), max_length=80, blank=True)
    group = models.ForeignKey(
        "accounts.RacerGroup", models.CASCADE, related_name="lti_contexts", verbose_name=_("group")
    )
    lineitems_url = models.CharField(_("URL of line items"), max_length=500, blank=True)
    scopes = models.JSONField(_("scopes"), default=list, blank=True)
    linked_at = models.DateTimeField(_("linked"), default=timezone.now)

    class Meta:
        verbose_name = _("course of a learning platform")
        verbose_name_plural = _("courses of learning platforms")
        ordering = ["pk"]
        constraints = [
            models.UniqueConstraint(fields=["platform", "deployment_id", "context_id"], name="lti_context_once")
        ]

    def __str__(self) -> str:
        return self.title or self.context_id


class LtiAccount(models.Model):
    """A person of a platform (``sub``) and their account here. With ``context`` it is the class account that was made
    for this course, which goes with the class; without one it is a teacher's, or one that its racer has linked."""

    platform = models.ForeignKey(
        LtiPlatform, models.CASCADE, related_name="accounts", verbose_name=_("learning platform")
    )
    sub = models.CharField(_("ID of the person"), max_length=LONGEST_ID)
    context = models.ForeignKey(
        LtiContext, models.CASCADE, null=True, blank=True, related_name="accounts", verbose_name=_("course")
    )
    racer = models.ForeignKey(
        settings.AUTH_USER_MODEL, models.CASCADE, related_name="lti_accounts", verbose_name=_("racer")
    )
    linked_at = models.DateTimeField(_("linked"), default=timezone.now)

    class Meta:
        verbose_name = _("account of a learning platform")
        verbose_name_plural = _("accounts of learning platforms")
        ordering = ["pk"]
        constraints = [
            models.UniqueConstraint(fields=["platform", "sub", "context"], name="lti_account_once_a_course"),
            models.UniqueConstraint(
                fields=["platform", "sub"], condition=Q(context__isnull=True), name="lti_account_once"
            ),
            models.UniqueConstraint(fields=["platform", "racer"], name="lti_account_of_one_person"),
        ]

    def __str__(self) -> str:
        return f"{self.platform_id}: {self.racer_id}"


class LtiLine(models.Model):
    """The column for an assignment's marks in a course's grade book; ``url`` is empty until it is known or made.
    ``looked_at``: when marks were last compared with what was sent."""

    context = models.ForeignKey(LtiContext, models.CASCADE, related_name="lines", verbose_name=_("course"))
    assignment = models.ForeignKey(
        "courses.Assignment", models.CASCADE, related_name="lti_lines", verbose_name=_("assignment")
    )
    url = models.CharField(_("URL of the line item"), max_length=500, blank=True)
    looked_at = models.DateTimeField(_("compared"), null=True, blank=True)

    class Meta:
        verbose_name = _("line item of a learning platform")
        verbose_name_plural = _("line items of learning platforms")
        ordering = ["pk"]
        constraints = [models.UniqueConstraint(fields=["context", "assignment"], name="lti_line_once")]

    def __str__(self) -> str:
        return f"{self.context_id}: {self.assignment_id}"


class LtiScoreState(models.TextChoices):
    """Whether the platform has the mark. A mark that changes makes a score due again."""

    DUE = "due", _("due")
    SENDING = "sending", _("being sent")
    SENT = "sent", _("sent")
    FAILED = "failed", _("failed")


class LtiScore(Job):
    """A student's mark on its way to a line item: the newest one, so that an older never follows it. ``points``,
    ``maximum`` and the platform's time ``stamp`` are those of the last try; a repeated try has the same."""

    line = models.ForeignKey(LtiLine, models.CASCADE, related_name="scores", verbose_name=_("line item"))
    racer = models.ForeignKey(
        settings.AUTH_USER_MODEL, models.CASCADE, related_name="lti_scores", verbose_name=_("racer")
    )
    state = models.CharField(_("state"), max_length=7, choices=LtiScoreState.choices, default=LtiScoreState.DUE)
    points = models.DecimalField(_("points"), max_digits=8, decimal_places=2, null=True, blank=True)
    maximum = models.DecimalField(_("of"), max_digits=8, decimal_places=2, null=True, blank=True)
    queued_at = models.DateTimeField(_("queued"), default=timezone.now)
    stamp = models.DateTimeField(_("time stamp"), null=True, blank=True)

    class Meta:
        verbose_name = _("score for a learning platform")
        verbose_name_plural = _("scores for learning platforms")
        ordering = ["pk"]
        indexes = [models.Index(fields=["queued_at"], condition=Q(state__in=["due", "sending"]), name="lti_scores_due")]
        constraints = [
            *lease_constraints("lti_score", waiting="due", working="sending", final=["sent", "failed"]),
            models.UniqueConstraint(fields=["line", "racer"], name="lti_score_once"),
        ]

    def __str__(self) -> str:
        return f"{self.line_id}: {self.racer_id}"
