"""A racer's own runs: any usable car on any track, private."""

from django.conf import settings
from django.db import models
from django.db.models import Q
from django.utils import timezone
from django.utils.functional import cached_property
from django.utils.translation import gettext_lazy as _

from core.jobs.models import reason_sentence
from paddock.rules.race import BOTS, RULES, RaceRules
from paddock.rules.ranked import NEEDED, RANKED

from .race import Race
from .rules import with_columns, within
from .submission import Submission


class OwnEvaluation(with_columns({name: RULES[name] for name in RANKED})):  # type: ignore[misc]
    """A run requested by a racer: private, and counted in no race.

    ``race``: the race whose rules it was driven by, where it was one. ``submission``: what was sent to that race
    because the run was better than the racer's best there; ``submit_reason_code``: why nothing was, where that was
    wished for. Once deleted it has no ``evaluation`` any more; the row stays for a day, because it counts for so long.
    """

    owner = models.ForeignKey(
        settings.AUTH_USER_MODEL, models.CASCADE, related_name="own_evaluations", verbose_name=_("owner")
    )
    evaluation = models.OneToOneField(
        "evaluation.Evaluation",
        models.CASCADE,
        null=True,
        blank=True,
        related_name="own",
        verbose_name=_("evaluation"),
    )
    race = models.ForeignKey(
        Race, models.SET_NULL, null=True, blank=True, related_name="own_evaluations", verbose_name=_("rules from race")
    )
    submit_if_better = models.BooleanField(_("submit if better"), default=False)
    submission = models.OneToOneField(
        Submission,
        models.SET_NULL,
        null=True,
        blank=True,
        related_name="own_evaluation",
        verbose_name=_("submission"),
    )
    submit_reason_code = models.CharField(_("reason for not submitting"), max_length=40, blank=True)
    submit_reason_params = models.JSONField(_("details"), default=dict, blank=True)
    asked_at = models.DateTimeField(_("requested at"), default=timezone.now)
    deleted_at = models.DateTimeField(_("deleted"), null=True, blank=True)

    class Meta:
        verbose_name = _("test run")
        verbose_name_plural = _("test runs")
        ordering = ["-asked_at", "-pk"]
        indexes = [models.Index(fields=["owner", "-asked_at", "-id"], name="own_of_a_racer")]
        constraints = [
            models.CheckConstraint(
                condition=Q(evaluation__isnull=False, deleted_at=None)
                | Q(evaluation__isnull=True, deleted_at__isnull=False),
                name="own_deleted_has_no_run",
            ),
            models.CheckConstraint(condition=within(NEEDED), name="own_minimum_laps_range"),
            models.CheckConstraint(
                condition=Q(submit_if_better=True) | Q(submission=None, submit_reason_code=""),
                name="own_submitted_as_wished",
            ),
            models.CheckConstraint(
                condition=Q(submission=None) | Q(submit_reason_code=""), name="own_submitted_or_a_reason"
            ),
        ]

    def __str__(self) -> str:
        return str(self.evaluation) if self.evaluation_id else f"{self.pk}"

    @property
    def submit_reason(self) -> str:
        """Why it was not submitted, in the reader's language, or ``""``."""
        return reason_sentence(self.submit_reason_code, self.submit_reason_params)

    @property
    def ranked(self) -> dict[str, object]:
        """Its ranking: the values of :data:`paddock.rules.ranked.RANKED`."""
        return {name: getattr(self, name) for name in RANKED}

    @cached_property
    def rules(self) -> RaceRules:
        """The rules of the run. Raises AttributeError once it is deleted."""
        assert self.evaluation is not None, "it is not deleted"
        return RaceRules.from_dict(self.evaluation.spec["rules"])

    @cached_property
    def as_race(self) -> Race:
        """An unsaved race with the run's rules, for its ranking and the texts of both."""
        values = {name: value for name, value in self.rules.to_dict().items() if name in RULES}
        values["boxes"] = list(values["boxes"])
        return Race(**values, **self.ranked, opponents=BOTS if self.rules.bots else "")
