"""Addresses of the training room's pages."""

from django.urls import path

from .cloning import views as cloning
from .jobs import views as trainings
from .lessons import views as lessons
from .rewards import views as rewards
from .rewards.audit import views as audit
from .rewards.laboratory import views as laboratory
from .starter_training import views as starter_training
from .sweeps import views as sweeps
from .vehicles import views as vehicles
from .wizard import views as wizard

urlpatterns = [
    path("train/", trainings.trainings, name="trainings"),
    path("train/new/", wizard.training_new, name="training_new"),
    path("train/first/", starter_training.training_first, name="training_first"),
    path("train/validate/", rewards.reward_validate, name="reward_validate"),
    path("train/audit/", audit.reward_audit, name="reward_audit"),
    path("train/sweeps/<str:public_id>/", sweeps.sweep, name="sweep"),
    path("train/sweeps/<str:public_id>/stop/", sweeps.sweep_stop, name="sweep_stop"),
    path("train/sweeps/<str:public_id>/delete/", sweeps.sweep_delete, name="sweep_delete"),
    path("train/<str:public_id>/", trainings.training, name="training"),
    path("train/<str:public_id>/live/", trainings.training_live, name="training_live"),
    path("train/<str:public_id>/stop/", trainings.training_stop, name="training_stop"),
    path("train/<str:public_id>/delete/", trainings.training_delete, name="training_delete"),
    path("train/<str:public_id>/evaluate/", trainings.training_evaluate, name="training_evaluate"),
    path("train/<str:public_id>/best.zip", trainings.training_file, {"file": "best"}, name="training_best"),
    path("train/<str:public_id>/last.zip", trainings.training_file, {"file": "last"}, name="training_last"),
    path("train/<str:public_id>/sb3.zip", trainings.training_file, {"file": "sb3"}, name="training_sb3"),
    path("train/<str:public_id>/logs.zip", trainings.training_file, {"file": "logs"}, name="training_logs"),
    path("train/<str:public_id>/metrics.json", trainings.training_file, {"file": "metrics"}, name="training_metrics"),
    path("train/<str:public_id>/trace.csv", trainings.training_file, {"file": "trace"}, name="training_trace"),
    path("models/shared/", cloning.shared, name="shared_models"),
    path("vehicles/", vehicles.vehicles, name="vehicles"),
    path("vehicles/new/", vehicles.vehicle_new, name="vehicle_new"),
    path("vehicles/<str:public_id>/", vehicles.vehicle_edit, name="vehicle_edit"),
    path("vehicles/<str:public_id>/delete/", vehicles.vehicle_delete, name="vehicle_delete"),
    path("learn/", lessons.learn, name="learn"),
    path("learn/laboratory/", laboratory.reward_lab, name="reward_lab"),
    path("learn/real-car/", lessons.real_car, name="real_car"),
    path("learn/elsewhere/", lessons.elsewhere, name="elsewhere"),
    path("learn/elsewhere/<str:name>", lessons.elsewhere_file, name="elsewhere_file"),
    path("learn/<slug:slug>/", lessons.lesson, name="lesson"),
]
