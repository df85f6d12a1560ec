"""Races have the engine of their results; runs are driven again when the site has another one."""

from typing import Any

import django.db.models.deletion
from django.conf import settings
from django.db import migrations, models
from django.db.models import Count


def name_engines(apps: Any, schema_editor: Any) -> None:
    """Give each race the engine of its counted results; where there are several, the one that most are of."""
    Race, Submission = apps.get_model("races", "Race"), apps.get_model("races", "Submission")
    counted = Submission.objects.filter(is_void=False, evaluation__result__isnull=False).order_by()
    found = counted.values_list("entry__race", "evaluation__result__engine").annotate(runs=Count("pk"))
    engines = {race: engine for race, engine, _runs in sorted(found, key=lambda row: row[2])}
    for engine in sorted(set(engines.values())):
        races = [race for race, its in engines.items() if its == engine]
        for begin in range(0, len(races), 500):
            Race.objects.filter(pk__in=races[begin : begin + 500]).update(engine=engine)


class Migration(migrations.Migration):

    dependencies = [
        ('evaluation', '0008_worker_heartbeats'),
        ('races', '0010_marks_of_classified_cars'),
        ('tracks', '0003_looks'),
        migrations.swappable_dependency(settings.AUTH_USER_MODEL),
    ]

    operations = [
        migrations.CreateModel(
            name='Redrive',
            fields=[
                ('id', models.BigAutoField(auto_created=True, primary_key=True, serialize=False, verbose_name='ID')),
                ('engine', models.CharField(max_length=32, verbose_name='engine')),
                ('tries', models.PositiveSmallIntegerField(default=1, verbose_name='runs')),
                ('state', models.CharField(choices=[('pending', 'under way'), ('taken', 'taken'), ('dropped', 'dropped')], default='pending', max_length=8, verbose_name='state')),
            ],
            options={
                'verbose_name': 'run driven again',
                'verbose_name_plural': 'runs driven again',
            },
        ),
        migrations.CreateModel(
            name='Retiming',
            fields=[
                ('id', models.BigAutoField(auto_created=True, primary_key=True, serialize=False, verbose_name='ID')),
                ('at', models.DateTimeField(verbose_name='at')),
                ('old_engine', models.CharField(max_length=32, verbose_name='engine before')),
                ('new_engine', models.CharField(max_length=32, verbose_name='engine')),
                ('old_score_ms', models.PositiveIntegerField(blank=True, null=True, verbose_name='score before')),
                ('new_score_ms', models.PositiveIntegerField(blank=True, null=True, verbose_name='score')),
                ('old_rank', models.PositiveIntegerField(blank=True, null=True, verbose_name='place before')),
                ('new_rank', models.PositiveIntegerField(blank=True, null=True, verbose_name='place')),
                ('reason_code', models.CharField(blank=True, max_length=40, verbose_name='reason')),
                ('reason_params', models.JSONField(blank=True, default=dict, verbose_name='details')),
            ],
            options={
                'verbose_name': 'changed time',
                'verbose_name_plural': 'changed times',
            },
        ),
        migrations.AddField(
            model_name='race',
            name='engine',
            field=models.CharField(blank=True, editable=False, max_length=32, verbose_name='engine'),
        ),
        migrations.AddField(
            model_name='race',
            name='next_engine',
            field=models.CharField(blank=True, editable=False, help_text='The engine that all counted runs are being driven again with; empty when none are.', max_length=32, verbose_name='driven again with'),
        ),
        migrations.AddIndex(
            model_name='race',
            index=models.Index(condition=models.Q(('next_engine', ''), _negated=True), fields=['next_engine'], name='race_driven_again'),
        ),
        migrations.AddConstraint(
            model_name='race',
            constraint=models.CheckConstraint(condition=models.Q(('next_engine', ''), models.Q(('engine', ''), _negated=True), _connector='OR'), name='race_driven_again_was_driven'),
        ),
        migrations.AddField(
            model_name='redrive',
            name='evaluation',
            field=models.OneToOneField(on_delete=django.db.models.deletion.PROTECT, related_name='redrive', to='evaluation.evaluation', verbose_name='evaluation'),
        ),
        migrations.AddField(
            model_name='redrive',
            name='replaced',
            field=models.OneToOneField(blank=True, null=True, on_delete=django.db.models.deletion.PROTECT, related_name='replaced_by', to='evaluation.evaluation', verbose_name='evaluation before'),
        ),
        migrations.AddField(
            model_name='redrive',
            name='submission',
            field=models.ForeignKey(db_index=False, on_delete=django.db.models.deletion.CASCADE, related_name='redrives', to='races.submission', verbose_name='submission'),
        ),
        migrations.AddField(
            model_name='retiming',
            name='entry',
            field=models.ForeignKey(db_index=False, on_delete=django.db.models.deletion.CASCADE, related_name='retimings', to='races.entry', verbose_name='entry'),
        ),
        migrations.AddIndex(
            model_name='redrive',
            index=models.Index(fields=['submission', 'state'], name='redrive_of_submission'),
        ),
        migrations.AddConstraint(
            model_name='redrive',
            constraint=models.UniqueConstraint(condition=models.Q(('state', 'pending')), fields=('submission',), name='redrive_pending_once_a_submission'),
        ),
        migrations.AddConstraint(
            model_name='redrive',
            constraint=models.CheckConstraint(condition=models.Q(('state__in', ['pending', 'taken', 'dropped'])), name='redrive_state_known'),
        ),
        migrations.AddConstraint(
            model_name='redrive',
            constraint=models.CheckConstraint(condition=models.Q(models.Q(('replaced__isnull', False), ('state', 'taken')), models.Q(models.Q(('state', 'taken'), _negated=True), ('replaced', None)), _connector='OR'), name='redrive_taken_replaces'),
        ),
        migrations.AddConstraint(
            model_name='redrive',
            constraint=models.CheckConstraint(condition=models.Q(models.Q(('engine', ''), _negated=True), ('tries__gte', 1)), name='redrive_for_an_engine'),
        ),
        migrations.AddIndex(
            model_name='retiming',
            index=models.Index(fields=['at'], name='retiming_by_time'),
        ),
        migrations.AddConstraint(
            model_name='retiming',
            constraint=models.UniqueConstraint(fields=('entry', 'at'), name='retiming_once_a_change'),
        ),
        migrations.AddConstraint(
            model_name='retiming',
            constraint=models.CheckConstraint(condition=models.Q(models.Q(('old_score_ms', models.F('new_score_ms')), _negated=True), models.Q(('new_score_ms__isnull', True), ('old_score_ms__isnull', True), _negated=True)), name='retiming_changes_a_score'),
        ),
        migrations.RunPython(name_engines, migrations.RunPython.noop, elidable=True),
    ]
