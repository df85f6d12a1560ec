from django.apps import AppConfig
from django.db.models.signals import post_delete
from django.utils.translation import gettext_lazy as _


class VideosConfig(AppConfig):
    name = "videos"
    verbose_name = _("Videos")

    def ready(self) -> None:
        from accounts import storage
        from accounts.quotas import register
        from evaluation.signals import model_deleted

        from . import queues
        from .models import Video
        from .quotas import VIDEO_FILES, VIDEOS_A_DAY, VIDEOS_AT_ONCE
        from .receivers import take_deleted_model
        from .services.keep import take_files_along

        for quota in (VIDEOS_AT_ONCE, VIDEOS_A_DAY):
            register(quota)
        storage.register(VIDEO_FILES)
        queues.register()
        model_deleted.connect(take_deleted_model, dispatch_uid="videos.take_deleted_model")
        post_delete.connect(take_files_along, sender=Video, dispatch_uid="videos.take_files_along")
