"""Why a training ended, and who stopped it."""

from django.conf import settings
from django.db import migrations, models
from django.db.models import Case, F, Q, Value, When


def write_down(apps, schema_editor):
    """Of trainings of before: what ended them shows in what they had done."""
    jobs = apps.get_model("training", "TrainingJob").objects
    for state in ("failed", "stopped"):
        jobs.filter(state=state).update(ended_because=state)
    jobs.filter(state="finished").update(
        ended_because=Case(
            When(Q(stop_steps__isnull=False) & Q(steps_done__gte=F("stop_steps")), then=Value("steps")),
            When(
                Q(stop_clean_laps__isnull=False) & Q(seconds_done__lt=F("stop_minutes") * 60.0),
                then=Value("clean_laps"),
            ),
            default=Value("time"),
        )
    )


class Migration(migrations.Migration):
    dependencies = [
        ("training", "0003_looks_of_models"),
        migrations.swappable_dependency(settings.AUTH_USER_MODEL),
    ]

    operations = [
        migrations.AddField(
            model_name="trainingjob",
            name="ended_because",
            field=models.CharField(
                blank=True,
                choices=[
                    ("time", "its minutes were used up"),
                    ("steps", "it had driven its steps"),
                    ("clean_laps", "it lapped cleanly"),
                    ("stopped", "it was stopped"),
                    ("failed", "it failed"),
                ],
                default="",
                max_length=10,
                verbose_name="why it ended",
            ),
            preserve_default=False,
        ),
        migrations.AddField(
            model_name="trainingjob",
            name="stopped_by",
            field=models.ForeignKey(
                blank=True,
                null=True,
                on_delete=models.SET_NULL,
                related_name="+",
                to=settings.AUTH_USER_MODEL,
                verbose_name="stopped by",
            ),
        ),
        migrations.RunPython(write_down, migrations.RunPython.noop, elidable=True),
    ]
