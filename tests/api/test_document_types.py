"""The types of what an operation reads have the fields of its serializer."""

from typing import is_typeddict

import pytest
from rest_framework.fields import empty
from rest_framework.serializers import Serializer

from config.api.views import LoginSerializer, SentLogin
from evaluation.garage.api import GarageFilter, GarageQuery, SentUpload, UploadSerializer
from evaluation.reports.api import NewReportSerializer, SentReport
from league.seasons.api.organising import SeasonCopySerializer, SentSeasonCopy
from league.webhooks.api import SentWebhook, WebhookBody
from paddock.rules.hyperparameters import HYPERPARAMETERS
from races.audit.api import AuditFilterSerializer, AuditPageQuery, AuditPageSerializer, AuditQuery
from races.pages.api.races import FilterSerializer, RaceQuery
from races.runs.api.videos import AskSerializer, SentVideo
from training.sweeps.api import CreateSweepSerializer, SentSweep
from training.trainer.spec import Hyperparameters
from training.vehicles.api import SentVehicle, VehicleBody

WHOLE: list[tuple[type, type[Serializer]]] = [
    (SentLogin, LoginSerializer),
    (GarageQuery, GarageFilter),
    (SentUpload, UploadSerializer),
    (SentReport, NewReportSerializer),
    (SentSeasonCopy, SeasonCopySerializer),
    (SentWebhook, WebhookBody),
    (AuditQuery, AuditFilterSerializer),
    (AuditPageQuery, AuditPageSerializer),
    (RaceQuery, FilterSerializer),
    (SentVideo, AskSerializer),
    (SentVehicle, VehicleBody),
]


@pytest.mark.parametrize(("document", "serializer"), [*WHOLE, (SentSweep, CreateSweepSerializer)])
def test_a_type_has_the_fields_of_its_serializer(document, serializer):
    assert is_typeddict(document)
    fields = serializer().fields
    present = {name for name, field in fields.items() if field.required or field.default is not empty}
    assert document.__required_keys__ <= present
    assert set(document.__annotations__) <= set(fields)
    if (document, serializer) in WHOLE:
        assert set(document.__annotations__) == set(fields)


def test_the_type_of_hyperparameters_has_all_of_them():
    assert set(Hyperparameters.__annotations__) == set(HYPERPARAMETERS)
