"""The tables of networks and of the models in garages."""

from django.conf import settings
from django.db import models
from django.db.models import Q
from django.urls import reverse
from django.utils import timezone
from django.utils.translation import gettext_lazy as _

from core.database.columns import OneLineField
from core.ids import new_public_id
from paddock.packages.kinds import FORMATS

from ..appearance.looks import COLOUR, DEFAULT_COLOUR, Shell, VehicleLook
from .stored_files import SHA256


class Network(models.Model):
    """The canonical bytes that run, stored once. ``sha256`` is a model's identity. ``facts``: of
    :class:`paddock.network.bound.NetworkFacts`; None for one that was admitted before there were any."""

    sha256 = models.CharField(_("sha-256"), max_length=64, primary_key=True)
    onnx = models.FileField(_("canonical ONNX"), upload_to="networks/")
    size = models.PositiveIntegerField(_("bytes"))
    parameters = models.PositiveIntegerField(_("weights"))
    macs = models.PositiveBigIntegerField(_("multiplications per step"))
    facts = models.JSONField(
        _("facts"),
        null=True,
        blank=True,
        help_text=_("Arithmetic properties measured on upload. Empty: measured at each start."),
    )
    created_at = models.DateTimeField(_("first seen"), default=timezone.now)

    class Meta:
        verbose_name = _("network")
        verbose_name_plural = _("networks")
        constraints = [models.CheckConstraint(condition=Q(sha256__regex=SHA256), name="network_sha256_form")]

    def __str__(self) -> str:
        return self.sha256[:12]


class TrainedModel(models.Model):
    """A racer's model: a trained network with its metadata. Immutable but for its name, description and look.

    ``deleted_at`` hides it from its owner's garage; its results stay. ``shared_at``: since when every racer may look at
    it, download it and train on from its weights.
    """

    public_id = models.CharField(max_length=12, unique=True, default=new_public_id, editable=False)
    owner = models.ForeignKey(settings.AUTH_USER_MODEL, models.CASCADE, related_name="models", verbose_name=_("owner"))
    name = OneLineField(_("name"), max_length=64)
    description = OneLineField(_("description"), max_length=255, blank=True)
    network = models.ForeignKey(Network, models.PROTECT, related_name="models", verbose_name=_("network"))
    metadata = models.JSONField(_("model metadata"))
    shell = models.CharField(_("shell"), max_length=16, choices=Shell.choices, default=Shell.PADDOCK)
    colour = models.CharField(_("colour"), max_length=7, default=DEFAULT_COLOUR)
    source_kind = models.CharField(_("uploaded as"), max_length=16)
    source_sha256 = models.CharField(_("sha-256 of the upload"), max_length=64)
    source_file = models.FileField(
        _("uploaded file"),
        upload_to="uploads/",
        max_length=255,
        blank=True,
        default="",
        db_default="",
        help_text=_("Empty for models trained here, and for uploads from before files were kept."),
    )
    source_name = OneLineField(_("file name of the upload"), max_length=255, blank=True, default="", db_default="")
    created_at = models.DateTimeField(_("uploaded"), default=timezone.now)
    deleted_at = models.DateTimeField(_("deleted"), null=True, blank=True)
    shared_at = models.DateTimeField(_("shared"), null=True, blank=True)

    class Meta:
        verbose_name = _("model")
        verbose_name_plural = _("models")
        ordering = ["-created_at", "-pk"]
        indexes = [
            # the page of shared models: the latest first
            models.Index(fields=["-shared_at", "-id"], condition=Q(shared_at__isnull=False), name="model_shared"),
        ]
        constraints = [
            models.CheckConstraint(
                condition=Q(deleted_at=None) | Q(shared_at=None), name="model_deleted_is_not_shared"
            ),
            models.UniqueConstraint(
                fields=["owner", "network"], condition=Q(deleted_at=None), name="model_uploaded_once_by_owner"
            ),
            models.UniqueConstraint(
                fields=["owner", "name"], condition=Q(deleted_at=None), name="model_name_unique_for_owner"
            ),
            models.CheckConstraint(condition=Q(shell__in=Shell.values), name="model_shell_known"),
            models.CheckConstraint(condition=Q(colour__regex=COLOUR), name="model_colour_form"),
            models.CheckConstraint(condition=Q(source_sha256__regex=SHA256), name="model_source_sha256_form"),
        ]

    def __str__(self) -> str:
        return self.name

    def get_absolute_url(self) -> str:
        return reverse("model", args=[self.public_id])

    @property
    def look(self) -> VehicleLook:
        return VehicleLook(self.shell, self.colour)

    @property
    def source_format(self) -> str:
        """The name of the uploaded format; its code where this site has no such format any more."""
        return FORMATS[self.source_kind].label if self.source_kind in FORMATS else self.source_kind

    @property
    def sensors(self) -> list[str]:
        return list(self.metadata["sensor"])
