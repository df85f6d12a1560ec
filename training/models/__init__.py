"""Vehicles, training jobs and what a job leaves behind. The table of jobs is the queue."""

from .choices import (
    FINAL_STATES,
    Algorithm,
    BestMetric,
    EndReason,
    JobState,
    NeuralNetwork,
    RewardSignature,
)
from .job import TrainingJob, TrainingTrack
from .record import Checkpoint, TrainingIteration
from .vehicle import Vehicle

__all__ = [
    "FINAL_STATES",
    "Algorithm",
    "BestMetric",
    "Checkpoint",
    "EndReason",
    "JobState",
    "NeuralNetwork",
    "RewardSignature",
    "TrainingIteration",
    "TrainingJob",
    "TrainingTrack",
    "Vehicle",
]
