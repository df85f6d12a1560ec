"""Personal data of trainings: all of it goes with the account."""

from core.personal_data.rules import PersonalData, register

from .models import Checkpoint, Sweep, SweepTrial, TrainingIteration, TrainingJob, Vehicle

_CAR = "sensors lidar_config"

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
)
