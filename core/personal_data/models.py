"""The table of files to delete."""

from django.db import models
from django.utils.translation import gettext_lazy as _


class DiscardedFile(models.Model):
    """A stored file to delete, noted in the transaction in which its row went."""

    name = models.CharField(_("name"), max_length=255, primary_key=True)
    at = models.DateTimeField(_("time"))

    class Meta:
        verbose_name = _("discarded file")
        verbose_name_plural = _("discarded files")

    def __str__(self) -> str:
        return self.name
