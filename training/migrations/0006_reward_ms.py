from django.db import migrations, models


def name_no_state(apps, schema_editor):
    """Trainings that failed before failures named the state of the car."""
    jobs = apps.get_model("training", "TrainingJob").objects.filter(reason_code="reward_raised")
    for job in jobs.only("reason_params").iterator():
        job.reason_params = {"state": "state not recorded", **job.reason_params}
        job.save(update_fields=["reason_params"])


class Migration(migrations.Migration):
    dependencies = [("training", "0005_lane_changes_and_standing_laps")]

    operations = [
        migrations.AddField(
            model_name="trainingjob",
            name="reward_ms",
            field=models.FloatField(
                blank=True,
                help_text="The average of all calls, in processor time.",
                null=True,
                verbose_name="milliseconds of a call of the reward function",
            ),
        ),
        migrations.RunPython(name_no_state, migrations.RunPython.noop),
    ]
