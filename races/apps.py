from django.apps import AppConfig
from django.db.models.signals import post_delete, post_migrate
from django.utils.translation import gettext_lazy as _


class RacesConfig(AppConfig):
    name = "races"
    verbose_name = _("Races")

    def ready(self) -> None:
        from accounts import storage
        from accounts.quotas import register
        from evaluation.signals import evaluation_ended, model_deleted

        from . import queues
        from .board_triggers import installed_after_migrate
        from .events import register_audiences
        from .models import Video
        from .quotas import RACES, VIDEO_FILES, VIDEOS_A_DAY, VIDEOS_AT_ONCE
        from .receivers import take_deleted_model, take_ended_evaluation
        from .services.videos.keep import take_files_along

        for quota in (RACES, VIDEOS_AT_ONCE, VIDEOS_A_DAY):
            register(quota)
        storage.register(VIDEO_FILES)
        queues.register()
        register_audiences()
        post_migrate.connect(installed_after_migrate, sender=self, dispatch_uid="races.board_triggers")
        evaluation_ended.connect(take_ended_evaluation, dispatch_uid="races.take_ended_evaluation")
        model_deleted.connect(take_deleted_model, dispatch_uid="races.take_deleted_model")
        post_delete.connect(take_files_along, sender=Video, dispatch_uid="races.take_files_along")
