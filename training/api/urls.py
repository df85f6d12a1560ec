"""Addresses of trainings below /api/v1/."""

from django.urls import path

from . import trainings

urlpatterns = [
    path("trainings/", trainings.TrainingsView.as_view(), name="api-trainings"),
    path("trainings/<slug:public_id>/", trainings.TrainingView.as_view(), name="api-training"),
    path("trainings/<slug:public_id>/stop/", trainings.TrainingStopView.as_view(), name="api-training-stop"),
    path("trainings/<slug:public_id>/metrics/", trainings.TrainingMetricsView.as_view(), name="api-training-metrics"),
]
