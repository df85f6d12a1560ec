"""What is over has a reason, and nothing else has one."""

from django.db import migrations, models
from django.db.models import Q


class Migration(migrations.Migration):
    dependencies = [("training", "0004_how_it_ended")]

    operations = [
        migrations.AddConstraint(
            model_name="trainingjob",
            constraint=models.CheckConstraint(
                condition=Q(ended_because="", state__in=["queued", "running"])
                | Q(ended_because__in=["time", "steps", "clean_laps"], state="finished")
                | Q(ended_because="stopped", state="stopped")
                | Q(ended_because="failed", state="failed"),
                name="training_end_has_reason",
            ),
        ),
    ]
