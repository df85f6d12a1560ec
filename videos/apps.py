from django.apps import AppConfig
from django.db.models.signals import post_delete
from django.utils.translation import gettext_lazy as _


class VideosConfig(AppConfig):
    name = "videos"
    verbose_name = _("Videos")

    def ready(self) -> None:
        from accounts.quotas import register
        from accounts.usage import storage
        from core.jobs.queues import Queue, register_queue
        from evaluation.signals import model_deleted

        from .models import Video
        from .quotas import VIDEO_FILES, VIDEOS_A_DAY, VIDEOS_AT_ONCE
        from .services import VIDEOS, redraw_video
        from .services.stored_files import take_deleted_model, take_files_along

        for quota in (VIDEOS_AT_ONCE, VIDEOS_A_DAY):
            register(quota)
        storage.register(VIDEO_FILES)
        register_queue(
            Queue(
                *("videos", _("Videos"), VIDEOS),
                related=("asked_by", "evaluation__track"),
                repeatable=lambda failed: failed,
                run_again=lambda video, now: redraw_video(video=video, now=now),
            )
        )
        model_deleted.connect(take_deleted_model, dispatch_uid="videos.take_deleted_model")
        post_delete.connect(take_files_along, sender=Video, dispatch_uid="videos.take_files_along")
