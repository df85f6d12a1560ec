"""Personal data of garages, runs, results and reports.

An official result must be driven again to be verified: its network, metadata, rules and traces stay, all else goes."""

from contextlib import suppress

from django.db import transaction
from django.db.models import ProtectedError

from core.personal_data.discarding import discard_files
from core.personal_data.rules import NEEDED, NOBODY, Leaving, PersonalData, register

from .models import Evaluation, EvaluationRival, Network, Result, RivalResult, StoredFile, TrainedModel, WorkerNode
from .models.reports import CarReport, ReportChunk


def _erase(leaving: Leaving) -> None:
    """Delete uploads, and the models and networks that no run in a race and no other racer needs."""
    CarReport.objects.filter(owner=leaving.racer).delete()
    models = TrainedModel.objects.filter(owner=leaving.racer)
    networks = set(models.values_list("network", flat=True))
    files = list(models.exclude(source_file="").values_list("source_file", flat=True))
    for model in models:
        with suppress(ProtectedError), transaction.atomic():
            model.delete()
    models.update(name="deleted", shared_at=None, deleted_at=leaving.now)
    for network in Network.objects.filter(pk__in=networks, models=None):
        with suppress(ProtectedError), transaction.atomic():
            network.delete()
            files.append(network.onnx.name or "")
    StoredFile.objects.filter(name__in=files).delete()
    discard_files(files, now=leaving.now)


_FAULTS = "reason_params operator_detail"
_RUN = "laps trajectory retired_params metrics"

register(
    "evaluation",
    PersonalData(CarReport, owner="owner", rows=True, section="car_reports", exported="rules reason_params"),
    PersonalData(
        ReportChunk,
        owner="report__owner",
        rows=True,
        withheld={"A part of the report's work.": "*"},
    ),
    PersonalData(
        RivalResult,
        owner="result__evaluation__owner",
        kept={NEEDED: f"{_RUN} trace"},
        withheld={"It is the result of another racer's car.": "*"},
    ),
    PersonalData(
        Result,
        owner="evaluation__owner",
        kept={NEEDED: f"{_RUN} trace order layout bots versions"},
        section="results",
        exported=f"{_RUN} trace order layout bots versions",
    ),
    PersonalData(
        EvaluationRival,
        owner="evaluation__owner",
        kept={NEEDED: "metadata"},
        withheld={"It is about another racer's car.": "*"},
    ),
    PersonalData(
        Evaluation,
        owner="owner",
        anonymised="owner",
        kept={NEEDED: f"spec progress {_FAULTS}"},
        section="runs",
        exported="spec progress reason_params",
        withheld={"A note for operators.": "operator_detail"},
    ),
    PersonalData(
        TrainedModel,
        owner="owner",
        erased="description source_file source_name",
        anonymised="owner name",
        kept={NEEDED: "metadata"},
        section="models",
        exported="name description metadata source_file source_name",
        files=lambda racer: TrainedModel.objects.filter(owner=racer).values_list("network__onnx", flat=True),
    ),
    PersonalData(Network, kept={"It proves an official result, or belongs to another racer too.": "onnx facts"}),
    PersonalData(StoredFile, kept={NOBODY: "name"}),
    PersonalData(WorkerNode, kept={NOBODY: "name queues sandbox proof"}),
    erase=_erase,
)
