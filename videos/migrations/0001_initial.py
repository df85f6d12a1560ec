import core.ids
import django.db.models.deletion
import django.utils.timezone
from django.conf import settings
from django.db import migrations, models


class Migration(migrations.Migration):

    initial = True

    dependencies = [
        ('evaluation', '0001_initial'),
        migrations.swappable_dependency(settings.AUTH_USER_MODEL),
    ]

    operations = [
        migrations.CreateModel(
            name='Video',
            fields=[
                ('id', models.BigAutoField(auto_created=True, primary_key=True, serialize=False, verbose_name='ID')),
                ('attempt', models.PositiveSmallIntegerField(db_default=0, default=0, verbose_name='attempt')),
                ('lease', models.UUIDField(blank=True, editable=False, null=True, verbose_name='lease')),
                ('leased_until', models.DateTimeField(blank=True, null=True, verbose_name='leased until')),
                ('worker', models.CharField(blank=True, db_default='', default='', max_length=128, verbose_name='worker')),
                ('not_before', models.DateTimeField(blank=True, null=True, verbose_name='pauses until')),
                ('started_at', models.DateTimeField(blank=True, null=True, verbose_name='started')),
                ('ended_at', models.DateTimeField(blank=True, null=True, verbose_name='ended')),
                ('reason_code', models.CharField(blank=True, max_length=40, verbose_name='reason')),
                ('reason_params', models.JSONField(blank=True, default=dict, verbose_name='details')),
                ('operator_detail', models.TextField(blank=True, verbose_name='for operators')),
                ('kills', models.PositiveSmallIntegerField(db_default=0, default=0, help_text='How often it failed alone, while others passed.', verbose_name='kills')),
                ('failed_at', models.DateTimeField(blank=True, null=True, verbose_name='last failed by our fault')),
                ('public_id', models.CharField(default=core.ids.new_public_id, editable=False, max_length=12, unique=True)),
                ('car', models.PositiveSmallIntegerField(default=0, verbose_name='car followed')),
                ('part', models.PositiveSmallIntegerField(default=0, help_text='0: the whole run, else a lap.', verbose_name='part')),
                ('language', models.CharField(max_length=8, verbose_name='language')),
                ('state', models.CharField(choices=[('waiting', 'waiting'), ('drawing', 'being drawn'), ('ready', 'ready'), ('failed', 'failed')], default='waiting', max_length=8, verbose_name='state')),
                ('progress', models.PositiveSmallIntegerField(default=0, help_text='Per cent.', verbose_name='progress')),
                ('asked_at', models.DateTimeField(default=django.utils.timezone.now, verbose_name='asked for')),
                ('asks', models.PositiveSmallIntegerField(default=1, verbose_name='times asked for')),
                ('watched_at', models.DateTimeField(blank=True, null=True, verbose_name='last watched')),
                ('fingerprint', models.CharField(blank=True, max_length=64, verbose_name='fingerprint')),
                ('file', models.FileField(blank=True, upload_to='videos/', verbose_name='file')),
                ('poster', models.FileField(blank=True, upload_to='videos/', verbose_name='still')),
                ('sha256', models.CharField(blank=True, max_length=64, verbose_name='sha-256 of the file')),
                ('size', models.PositiveBigIntegerField(default=0, verbose_name='bytes')),
                ('duration_ms', models.PositiveIntegerField(default=0, verbose_name='length')),
                ('width', models.PositiveSmallIntegerField(default=0, verbose_name='width')),
                ('height', models.PositiveSmallIntegerField(default=0, verbose_name='height')),
                ('asked_by', models.ForeignKey(blank=True, null=True, on_delete=django.db.models.deletion.SET_NULL, related_name='+', to=settings.AUTH_USER_MODEL, verbose_name='asked by')),
                ('evaluation', models.ForeignKey(db_index=False, on_delete=django.db.models.deletion.CASCADE, related_name='videos', to='evaluation.evaluation', verbose_name='evaluation')),
            ],
            options={
                'verbose_name': 'video',
                'verbose_name_plural': 'videos',
                'ordering': ['-asked_at', '-pk'],
                'indexes': [models.Index(condition=models.Q(('state', 'waiting')), fields=['asked_at', 'id'], name='video_queue'), models.Index(condition=models.Q(('state', 'drawing')), fields=['leased_until'], name='video_leases'), models.Index(condition=models.Q(('state', 'ready')), fields=['watched_at'], name='video_by_watching'), models.Index(fields=['asked_by', '-asked_at'], name='video_of_racer')],
                'constraints': [models.CheckConstraint(condition=models.Q(('state__in', ['waiting', 'drawing', 'ready', 'failed'])), name='video_state_known'), models.CheckConstraint(condition=models.Q(models.Q(('lease__isnull', False), ('leased_until__isnull', False), ('started_at__isnull', False), ('state', 'drawing')), models.Q(models.Q(('state', 'drawing'), _negated=True), ('lease__isnull', True), ('leased_until__isnull', True)), _connector='OR'), name='video_lease_while_drawing'), models.CheckConstraint(condition=models.Q(models.Q(('ended_at__isnull', False), ('state__in', ['ready', 'failed'])), models.Q(('ended_at__isnull', True), ('state__in', ['waiting', 'drawing'])), _connector='OR'), name='video_ended_when_final'), models.CheckConstraint(condition=models.Q(('not_before__isnull', True), ('state', 'waiting'), _connector='OR'), name='video_pauses_while_waiting'), models.UniqueConstraint(fields=('evaluation', 'car', 'part', 'language'), name='video_made_once'), models.CheckConstraint(condition=models.Q(('car__lt', 4)), name='video_car_in_range'), models.CheckConstraint(condition=models.Q(('progress__lte', 100)), name='video_progress_in_range'), models.CheckConstraint(condition=models.Q(('language', ''), _negated=True), name='video_has_language'), models.CheckConstraint(condition=models.Q(models.Q(('state', 'failed'), models.Q(('reason_code', ''), _negated=True)), models.Q(models.Q(('state', 'failed'), _negated=True), ('reason_code', '')), _connector='OR'), name='video_failed_for_a_reason'), models.CheckConstraint(condition=models.Q(models.Q(models.Q(('state', 'ready'), _negated=True), ('duration_ms', 0), ('file', ''), ('poster', ''), ('sha256', ''), ('size', 0), ('watched_at', None)), models.Q(models.Q(('file', ''), ('poster', ''), _connector='OR', _negated=True), ('duration_ms__gt', 0), ('fingerprint__regex', '^[0-9a-f]{64}$'), ('sha256__regex', '^[0-9a-f]{64}$'), ('size__gt', 0), ('state', 'ready'), ('watched_at__isnull', False)), _connector='OR'), name='video_ready_has_a_file')],
            },
        ),
    ]
