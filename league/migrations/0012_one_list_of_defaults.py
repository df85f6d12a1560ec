"""Defaults are Python's: nothing changes in the database, and no table is made anew for them."""

import django.core.validators
from django.db import migrations, models


class Migration(migrations.Migration):

    dependencies = [
        ('league', '0011_notices_of_decisions'),
    ]

    operations = [
        migrations.SeparateDatabaseAndState(
            state_operations=[
                migrations.AlterField(
                    model_name='stagerules',
                    name='max_simulated_ms',
                    field=models.PositiveIntegerField(default=180000, validators=[django.core.validators.MinValueValidator(10000), django.core.validators.MaxValueValidator(1200000)], verbose_name='time limit in simulated milliseconds'),
                ),
                migrations.AlterField(
                    model_name='stagerules',
                    name='off_track_penalty_ms',
                    field=models.PositiveIntegerField(default=2000, validators=[django.core.validators.MaxValueValidator(60000)], verbose_name='off-track penalty in milliseconds'),
                ),
            ]
        ),
    ]
