"""Personal data of garages, runs, results and reports.

An official result must be driven again to be verified: its network, metadata, rules and traces stay, all else goes."""

from core.personal_data.rules import NEEDED, NOBODY, PersonalData, register

from .models import Evaluation, EvaluationRival, Network, Result, RivalResult, StoredFile, TrainedModel, WorkerNode
from .models.reports import CarReport, ReportChunk

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
    ),
    PersonalData(Network, kept={"It proves an official result, or belongs to another racer too.": "onnx facts"}),
    PersonalData(StoredFile, kept={NOBODY: "name"}),
    PersonalData(WorkerNode, kept={NOBODY: "name queues sandbox proof"}),
)
