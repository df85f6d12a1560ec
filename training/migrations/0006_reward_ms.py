from django.db import migrations, models


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
    ]
