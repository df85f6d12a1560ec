import django.db.models.deletion
import django.db.models.functions.datetime
from django.conf import settings
from django.db import migrations, models


class Migration(migrations.Migration):

    initial = True

    dependencies = [
        migrations.swappable_dependency(settings.AUTH_USER_MODEL),
    ]

    operations = [
        migrations.CreateModel(
            name='EventCursor',
            fields=[
                ('reader', models.CharField(max_length=32, primary_key=True, serialize=False, verbose_name='reader')),
                ('position', models.PositiveBigIntegerField(default=0, verbose_name='position')),
            ],
            options={
                'verbose_name': 'reader of events',
                'verbose_name_plural': 'readers of events',
            },
        ),
        migrations.CreateModel(
            name='Outage',
            fields=[
                ('id', models.BigAutoField(auto_created=True, primary_key=True, serialize=False, verbose_name='ID')),
                ('part', models.CharField(choices=[('storage', 'storage of files')], max_length=16, unique=True, verbose_name='part')),
                ('since', models.DateTimeField(verbose_name='since')),
                ('look_at', models.DateTimeField(verbose_name='looked at next')),
                ('looks', models.PositiveIntegerField(default=1, verbose_name='looked at')),
            ],
            options={
                'verbose_name': 'outage',
                'verbose_name_plural': 'outages',
                'ordering': ['since'],
                'constraints': [models.CheckConstraint(condition=models.Q(('part__in', ['storage'])), name='outage_part_known'), models.CheckConstraint(condition=models.Q(('look_at__gt', models.F('since'))), name='outage_looked_at_later')],
            },
        ),
        migrations.CreateModel(
            name='Event',
            fields=[
                ('id', models.BigAutoField(auto_created=True, primary_key=True, serialize=False, verbose_name='ID')),
                ('position', models.PositiveBigIntegerField(editable=False, null=True, unique=True, verbose_name='position')),
                ('kind', models.CharField(max_length=32, verbose_name='kind')),
                ('at', models.DateTimeField(verbose_name='happened')),
                ('recorded_at', models.DateTimeField(db_default=django.db.models.functions.datetime.Now(), db_index=True, editable=False, verbose_name='recorded')),
                ('race', models.PositiveBigIntegerField(blank=True, null=True, verbose_name='race')),
                ('subject', models.CharField(blank=True, max_length=64, verbose_name='subject')),
                ('data', models.JSONField(blank=True, default=dict, verbose_name='data')),
                ('once', models.CharField(blank=True, editable=False, max_length=160, null=True, verbose_name='once for')),
                ('racer', models.ForeignKey(blank=True, db_index=False, null=True, on_delete=django.db.models.deletion.CASCADE, related_name='+', to=settings.AUTH_USER_MODEL, verbose_name='racer')),
            ],
            options={
                'verbose_name': 'event',
                'verbose_name_plural': 'events',
                'ordering': ['position', 'pk'],
                'indexes': [models.Index(condition=models.Q(('position', None)), fields=['id'], name='event_without_position'), models.Index(fields=['racer', 'position'], name='event_by_racer'), models.Index(fields=['race', 'position'], name='event_by_race')],
                'constraints': [models.UniqueConstraint(fields=('kind', 'once'), name='event_once'), models.CheckConstraint(condition=models.Q(('kind', ''), _negated=True), name='event_has_a_kind')],
            },
        ),
    ]
