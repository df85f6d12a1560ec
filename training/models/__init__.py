"""Vehicles, training jobs and their records; the table of jobs is the queue."""

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
from .record import Checkpoint, SightDocument, TrainingIteration, TrainingProgress
from .sweep import Sweep, SweepState, SweepTrial
from .vehicle import Vehicle
