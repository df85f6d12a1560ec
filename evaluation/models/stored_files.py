"""The table of stored files with their checksums."""

from django.db import models
from django.db.models import Q
from django.utils.translation import gettext_lazy as _

SHA256 = r"^[0-9a-f]{64}$"


class Damage(models.TextChoices):
    MISSING = "missing", _("missing")
    ALTERED = "altered", _("altered")


class StoredFile(models.Model):
    """The checksum of a stored file, and its last check. ``sha256``: ``""`` only for a file that was damaged before its
    sum was known. ``checked_at``: of the nightly check."""

    name = models.CharField(_("name"), max_length=255, primary_key=True)
    sha256 = models.CharField(_("sha-256"), max_length=64, blank=True)
    size = models.PositiveBigIntegerField(_("bytes"))
    checked_at = models.DateTimeField(_("checked"), null=True, blank=True, db_index=True)
    damage = models.CharField(_("damage"), max_length=8, choices=Damage.choices, blank=True)
    damaged_at = models.DateTimeField(_("damage found"), null=True, blank=True)

    class Meta:
        verbose_name = _("stored file")
        verbose_name_plural = _("stored files")
        indexes = [models.Index(fields=["damaged_at"], condition=~Q(damage=""), name="storedfile_damaged")]
        constraints = [
            models.CheckConstraint(
                condition=Q(sha256__regex=SHA256) | Q(sha256="") & ~Q(damage=""), name="storedfile_sha256_form"
            ),
            models.CheckConstraint(
                condition=Q(damage="", damaged_at__isnull=True) | Q(damage__in=Damage.values, damaged_at__isnull=False),
                name="storedfile_damage_has_time",
            ),
        ]

    def __str__(self) -> str:
        return self.name
