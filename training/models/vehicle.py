"""A racer's vehicles: sensors, network and look of a car to be trained."""

from django.conf import settings
from django.core.validators import RegexValidator
from django.db import models
from django.db.models import Q
from django.utils import timezone
from django.utils.translation import gettext_lazy as _

from core.database.columns import OneLineField
from core.ids import new_public_id
from evaluation.appearance.looks import COLOUR, DEFAULT_COLOUR, Shell

from .choices import NeuralNetwork


def default_sensors() -> list[str]:
    """The sensors of a new vehicle."""
    return ["FRONT_FACING_CAMERA"]


class Vehicle(models.Model):
    """A vehicle of a racer's garage. A training job keeps a copy, so changing or deleting one changes no job."""

    public_id = models.CharField(max_length=12, unique=True, default=new_public_id, editable=False)
    owner = models.ForeignKey(
        settings.AUTH_USER_MODEL, models.CASCADE, related_name="vehicles", verbose_name=_("owner")
    )
    name = OneLineField(_("name"), max_length=64)
    sensors = models.JSONField(_("sensors"), default=default_sensors)
    lidar_config = models.JSONField(_("lidar settings"), default=dict, blank=True)
    neural_network = models.CharField(
        _("network"), max_length=40, choices=NeuralNetwork.choices, default=NeuralNetwork.SHALLOW
    )
    shell = models.CharField(_("shell"), max_length=16, choices=Shell.choices, default=Shell.PADDOCK)
    colour = models.CharField(_("colour"), max_length=7, default=DEFAULT_COLOUR, validators=[RegexValidator(COLOUR)])
    created_at = models.DateTimeField(_("added"), default=timezone.now, editable=False)

    class Meta:
        verbose_name = _("vehicle")
        verbose_name_plural = _("vehicles")
        ordering = ["name", "pk"]
        constraints = [
            models.UniqueConstraint(fields=["owner", "name"], name="vehicle_name_unique_for_owner"),
            models.CheckConstraint(condition=~Q(name=""), name="vehicle_has_a_name"),
            models.CheckConstraint(condition=Q(colour__regex=COLOUR), name="vehicle_colour_form"),
            models.CheckConstraint(condition=Q(shell__in=Shell.values), name="vehicle_shell_known"),
            models.CheckConstraint(condition=Q(neural_network__in=NeuralNetwork.values), name="vehicle_network_known"),
            models.CheckConstraint(condition=~Q(sensors=[]), name="vehicle_has_sensors"),
        ]

    def __str__(self) -> str:
        return self.name
