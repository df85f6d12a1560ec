"""The table of stored answers to repeatable writes."""

from django.conf import settings
from django.db import models
from django.utils.translation import gettext_lazy as _


class StoredAnswer(models.Model):
    """The answer to a request with an idempotency key: hashes of key and request, and the encrypted body."""

    racer = models.ForeignKey(
        settings.AUTH_USER_MODEL, models.CASCADE, related_name="+", db_index=False, verbose_name=_("racer")
    )
    digest = models.CharField(_("key"), max_length=64)
    request = models.CharField(_("request"), max_length=64)
    status = models.PositiveSmallIntegerField(_("status"))
    body = models.TextField(_("answer"), blank=True)
    made_at = models.DateTimeField(_("time"), db_index=True)

    class Meta:
        verbose_name = _("stored answer")
        verbose_name_plural = _("stored answers")
        constraints = [models.UniqueConstraint(fields=["racer", "digest"], name="stored_answer_once")]

    def __str__(self) -> str:
        return self.digest
