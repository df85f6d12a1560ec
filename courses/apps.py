from django.apps import AppConfig
from django.utils.translation import gettext_lazy as _


class CoursesConfig(AppConfig):
    name = "courses"
    verbose_name = _("Courses")

    def ready(self) -> None:
        from core.pages.registry import register_slots

        register_slots(
            {
                "account.log_in": "courses/classes/parts/card_log_in.html",
                "menu.account": "courses/classes/parts/menu.html",
            }
        )
