"""Addresses of the training room."""

from django.urls import path

from .views import classes, files, lab, learn, shared, trainings, vehicles, wizard

urlpatterns = [
    path("train/", trainings.trainings, name="trainings"),
    path("train/new/", wizard.training_new, name="training_new"),
    path("train/first/", trainings.training_first, name="training_first"),
    path("train/validate/", wizard.reward_validate, name="reward_validate"),
    path("train/<str:public_id>/", trainings.training, name="training"),
    path("train/<str:public_id>/live/", trainings.training_live, name="training_live"),
    path("train/<str:public_id>/stop/", trainings.training_stop, name="training_stop"),
    path("train/<str:public_id>/delete/", trainings.training_delete, name="training_delete"),
    path("train/<str:public_id>/evaluate/", trainings.training_evaluate, name="training_evaluate"),
    path("train/<str:public_id>/best.zip", files.training_package, {"which": "best"}, name="training_best"),
    path("train/<str:public_id>/last.zip", files.training_package, {"which": "last"}, name="training_last"),
    path("train/<str:public_id>/sb3.zip", files.training_sb3, name="training_sb3"),
    path("train/<str:public_id>/logs.zip", files.training_logs, name="training_logs"),
    path("train/<str:public_id>/metrics.json", files.training_metrics_file, name="training_metrics"),
    path("train/<str:public_id>/trace.csv", files.training_trace, name="training_trace"),
    path("models/shared/", shared.shared, name="shared_models"),
    path("vehicles/", vehicles.vehicles, name="vehicles"),
    path("vehicles/new/", vehicles.vehicle_new, name="vehicle_new"),
    path("vehicles/<str:public_id>/", vehicles.vehicle_edit, name="vehicle_edit"),
    path("vehicles/<str:public_id>/delete/", vehicles.vehicle_delete, name="vehicle_delete"),
    path("classes/", classes.classrooms, name="classrooms"),
    path("classes/<slug:slug>/", classes.classroom, name="classroom"),
    path("class/", classes.class_log_in, name="class_log_in"),
    path("class/<str:code>/", classes.class_log_in, name="class_code"),
    path("learn/", learn.learn, name="learn"),
    path("learn/laboratory/", lab.reward_lab, name="reward_lab"),
    path("learn/real-car/", learn.real_car, name="real_car"),
    path("learn/elsewhere/", learn.elsewhere, name="elsewhere"),
    path("learn/elsewhere/<str:name>", learn.elsewhere_file, name="elsewhere_file"),
    path("learn/<slug:slug>/", learn.lesson, name="lesson"),
]
