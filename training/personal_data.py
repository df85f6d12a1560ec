"""Personal data of trainings: all of it goes with the account."""

from django.db.models import QuerySet, Sum

from core.personal_data.discarding import discard_files
from core.personal_data.retention import RetentionPolicy
from core.personal_data.rules import Leaving, PersonalData, register
from evaluation.models import StoredFile

from .jobs.services.records import purge_trainings
from .models import Checkpoint, Sweep, SweepTrial, TrainingIteration, TrainingJob, Vehicle
from .quotas import files_of


def _erase(leaving: Leaving) -> None:
    jobs = TrainingJob.objects.filter(owner=leaving.racer)
    discard_files((name for job in jobs for name in files_of(job)), now=leaving.now)


_CAR = "sensors lidar_config"


def _weight_of_traces(rows: QuerySet[TrainingIteration]) -> int:
    files = StoredFile.objects.filter(name__in=rows.values("simtrace"))
    return files.aggregate(size=Sum("size"))["size"] or 0


register(
    "training",
    PersonalData(SweepTrial, owner="sweep__owner", rows=True, section="search_trials", exported="setting results"),
    PersonalData(Sweep, owner="owner", rows=True, section="searches", exported="name space reason_params"),
    PersonalData(
        Checkpoint,
        owner="job__owner",
        rows=True,
        withheld={"The state of a trainer that has not ended, which only this site can read.": "*"},
    ),
    PersonalData(
        TrainingIteration,
        owner="job__owner",
        rows=True,
        section="training_iterations",
        exported="episodes eval_trials simtrace",
    ),
    PersonalData(
        TrainingJob,
        owner="owner",
        rows=True,
        erased="stopped_by",
        section="trainings",
        exported=f"name description reward_code boxes hyperparameters action_space {_CAR} log printed progress sb3_zip "
        "reason_params evaluate_reason_params submit_reason_params",
        withheld={
            "The picture of a page that follows the training.": "driving seen",
            "A note for operators.": "operator_detail",
            "It names an admin or a teacher.": "stopped_by",
        },
    ),
    PersonalData(Vehicle, owner="owner", rows=True, section="vehicles", exported=f"name {_CAR}"),
    erase=_erase,
    policies=[
        RetentionPolicy(
            "training_traces",
            "TRAINING_TRACES_KEPT_DAYS",
            lambda before, now: TrainingIteration.objects.filter(job__ended_at__lt=before).exclude(simtrace=""),
            lambda rows, now: purge_trainings(now=now),
            _weight_of_traces,
        )
    ],
)
