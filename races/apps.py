from django.apps import AppConfig
from django.db.models.signals import post_migrate
from django.utils.translation import gettext_lazy as _


class RacesConfig(AppConfig):
    name = "races"
    verbose_name = _("Races")

    def ready(self) -> None:
        from accounts.quotas import register
        from core.cards.registry import register_cards
        from core.pages.registry import register_slots
        from evaluation.signals import evaluation_ended
        from tracks.reference.selectors import register_demand

        from . import streams
        from .aftermath import certificate
        from .boards import track_figures
        from .boards.triggers import installed_after_migrate
        from .duels.services import recount
        from .entries import eligibility, hooks, queues
        from .live.services.sealing import take_out_departed
        from .quotas import OWN_RUNS_A_DAY, OWN_RUNS_AT_ONCE, RACES
        from .receivers import take_ended_evaluation
        from .runs import latest_run
        from .runs import video_titles as video_words
        from .spoilers import hidden_addresses as spoiler_pages
        from .spoilers import selectors as spoilers
        from .timing import selectors as timing
        from .web import race_page

        eligibility.CHECKS += [eligibility.check_program, eligibility.check_group]
        eligibility.CHECKS += [eligibility.check_team, eligibility.check_learner]
        for quota in (RACES, OWN_RUNS_AT_ONCE, OWN_RUNS_A_DAY):
            register(quota)
        race_page.PARTS += [feature.race_page_part for feature in (spoilers, latest_run, timing, certificate)]
        hooks.RECOUNTS.append(recount)
        hooks.DEPARTURES.append(take_out_departed)
        video_words.register()
        queues.register()
        track_figures.register()
        register_demand(track_figures.raced_ways)
        streams.register()
        spoiler_pages.register()
        register_cards(("races.cards.races", "races.cards.runs"))
        register_slots(
            {
                "foot.links": "races/spoilers/foot.html",
                "garage.result": "races/spoilers/garage_result.html",
                "garage.actions": "races/test_runs/to_runs.html",
                "garage.row": "races/test_runs/drive_model.html",
                "model.actions": "races/test_runs/drive_model.html",
                "model.runs": "races/runs/model_runs.html",
                "track.actions": "races/pages/parts/hold_here.html",
                "group.races": "races/pages/parts/group_races.html",
                "track.reference": "races/replays/to_reference.html",
                "track.races": "races/pages/parts/races_here.html",
            }
        )
        register_slots({"track.actions": "races/driving/drive_here.html"})
        post_migrate.connect(installed_after_migrate, sender=self, dispatch_uid="races.boards.triggers")
        evaluation_ended.connect(take_ended_evaluation, dispatch_uid="races.take_ended_evaluation")
