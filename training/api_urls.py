"""Addresses of the training room's API."""

from django.urls import path

from .jobs.api import files, trainings
from .rewards import api as rewards
from .rewards.audit import api as audit
from .sweeps import api as sweeps
from .vehicles import api as vehicles

urlpatterns = [
    path("vehicles/", vehicles.VehiclesView.as_view(), name="api-vehicles"),
    path("vehicles/<slug:public_id>/", vehicles.VehicleView.as_view(), name="api-vehicle"),
    path("reward-functions/validate/", rewards.RewardValidationView.as_view(), name="api-reward-validate"),
    path("reward-functions/audit/", audit.RewardAuditView.as_view(), name="api-reward-audit"),
    path("sweeps/", sweeps.SweepsView.as_view(), name="api-sweeps"),
    path("sweeps/<slug:public_id>/", sweeps.SweepView.as_view(), name="api-sweep"),
    path("sweeps/<slug:public_id>/stop/", sweeps.SweepStopView.as_view(), name="api-sweep-stop"),
    path("trainings/", trainings.TrainingsView.as_view(), name="api-trainings"),
    path("trainings/<slug:public_id>/", trainings.TrainingView.as_view(), name="api-training"),
    path("trainings/<slug:public_id>/stop/", trainings.TrainingStopView.as_view(), name="api-training-stop"),
    path(
        "trainings/<slug:public_id>/evaluations/",
        trainings.TrainingEvaluationsView.as_view(),
        name="api-training-evaluations",
    ),
    path("trainings/<slug:public_id>/metrics/", trainings.TrainingMetricsView.as_view(), name="api-training-metrics"),
    path("trainings/<slug:public_id>/package/", files.TrainingPackageView.as_view(), name="api-training-package"),
    path("trainings/<slug:public_id>/sb3/", files.TrainingSb3View.as_view(), name="api-training-sb3"),
    path("trainings/<slug:public_id>/logs/", files.TrainingLogsView.as_view(), name="api-training-logs"),
    path("trainings/<slug:public_id>/trace/", files.TrainingTraceView.as_view(), name="api-training-trace"),
]
