from django.apps import AppConfig
from django.db.models.signals import post_migrate
from django.utils.translation import gettext_lazy as _


class RacesConfig(AppConfig):
    name = "races"
    verbose_name = _("Races")

    def ready(self) -> None:
        from accounts.quotas import register
        from core.pages import register_slots
        from evaluation.signals import evaluation_ended

        from . import queues, spoiler_pages, streams, track_figures, video_words
        from .board_triggers import installed_after_migrate
        from .eligibility import register as check_races
        from .events import register_audiences
        from .quotas import OWN_RUNS_A_DAY, OWN_RUNS_AT_ONCE, RACES
        from .receivers import take_ended_evaluation
        from .restricted import check_group, check_learner, check_team

        check_races(check_group)
        check_races(check_team)
        check_races(check_learner)
        for quota in (RACES, OWN_RUNS_AT_ONCE, OWN_RUNS_A_DAY):
            register(quota)
        video_words.register()
        queues.register()
        track_figures.register()
        register_audiences()
        streams.register()
        spoiler_pages.register()
        register_slots(
            {
                "foot.links": "races/spoilers/foot.html",
                "garage.result": "races/spoilers/garage_result.html",
                "garage.actions": "races/own/to_runs.html",
                "garage.row": "races/own/drive_model.html",
                "model.actions": "races/own/drive_model.html",
                "model.runs": "races/parts/model_runs.html",
                "track.actions": "races/parts/hold_here.html",
                "group.races": "races/parts/group_races.html",
                "track.races": "races/parts/races_here.html",
            }
        )
        post_migrate.connect(installed_after_migrate, sender=self, dispatch_uid="races.board_triggers")
        evaluation_ended.connect(take_ended_evaluation, dispatch_uid="races.take_ended_evaluation")
