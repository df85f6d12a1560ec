"""Defaults are Python's: nothing changes in the database, and no table is made anew for them."""

import django.core.validators
from django.db import migrations, models


class Migration(migrations.Migration):

    dependencies = [
        ('races', '0008_videos'),
    ]

    operations = [
        migrations.SeparateDatabaseAndState(
            state_operations=[
                migrations.AlterField(
                    model_name='race',
                    name='off_track_penalty_ms',
                    field=models.PositiveIntegerField(default=2000, validators=[django.core.validators.MaxValueValidator(60000)], verbose_name='off-track penalty in milliseconds'),
                ),
            ]
        ),
    ]
