from django.apps import AppConfig
from django.conf import settings
from django.utils.translation import gettext_lazy as _


class CoursesConfig(AppConfig):
    name = "courses"
    verbose_name = _("Courses")

    def ready(self) -> None:
        from django.db.models.signals import pre_delete

        from accounts.quotas import register
        from core.events import register_reader
        from core.pages.registry import register_slots
        from core.streams import register_moves
        from evaluation.signals import evaluation_ended
        from races.entries.selectors.visibility import AUDIENCES, RunAudience

        from .assignments.selectors import moves
        from .assignments.services import take_runs_along
        from .attempts.selectors import runs_seen, sees_run
        from .attempts.services import take_ended_evaluation
        from .notices import NOTICES
        from .quotas import ASSIGNMENTS

        register(ASSIGNMENTS)
        register_reader(NOTICES)
        register_moves(moves)
        AUDIENCES.append(RunAudience(sees_run, runs_seen))
        pre_delete.connect(take_runs_along, sender="courses.Assignment", dispatch_uid="courses.take_runs_along")
        evaluation_ended.connect(take_ended_evaluation, dispatch_uid="courses.take_ended_evaluation")

        register_slots(
            {
                "account.log_in": "courses/classes/parts/card_log_in.html",
                "menu.account": "courses/classes/parts/menu.html",
                "group.races": "courses/assignments/of_group.html",
                "home.next": "courses/attempts/due.html",
                "run.crumb": "courses/attempts/run_crumb.html",
            }
        )
        if settings.LTI:
            from .lti.scores import SCORES  # noqa: F401  # registers its kind of job

            register_slots({"class.head": "courses/lti/class_link.html"})
