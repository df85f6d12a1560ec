import core.ids
import django.db.models.deletion
import django.utils.timezone
import evaluation.models
import uuid
from django.conf import settings
from django.db import migrations, models


class Migration(migrations.Migration):

    initial = True

    dependencies = [
        ('tracks', '0001_initial'),
        migrations.swappable_dependency(settings.AUTH_USER_MODEL),
    ]

    operations = [
        migrations.CreateModel(
            name='WorkerNode',
            fields=[
                ('id', models.BigAutoField(auto_created=True, primary_key=True, serialize=False, verbose_name='ID')),
                ('name', models.CharField(max_length=128, unique=True, verbose_name='name')),
                ('seen_at', models.DateTimeField(db_index=True, verbose_name='last seen')),
                ('started_at', models.DateTimeField(blank=True, null=True, verbose_name='started')),
                ('stopped_at', models.DateTimeField(blank=True, null=True, verbose_name='shut down')),
                ('queues', models.JSONField(blank=True, default=list, verbose_name='queues')),
                ('processes', models.PositiveSmallIntegerField(default=1, verbose_name='processes')),
                ('sandbox', models.JSONField(blank=True, default=dict, verbose_name='sandbox')),
                ('proof', models.JSONField(blank=True, default=dict, verbose_name='golden runs')),
                ('engine', models.CharField(blank=True, max_length=32, verbose_name='engine')),
            ],
            options={
                'verbose_name': 'worker',
                'verbose_name_plural': 'workers',
                'ordering': ['-seen_at'],
            },
        ),
        migrations.CreateModel(
            name='Evaluation',
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
                ('spec', models.JSONField(verbose_name='specification')),
                ('priority', models.SmallIntegerField(default=0, help_text='Higher runs first.', verbose_name='priority')),
                ('turn', models.PositiveIntegerField(blank=True, help_text='Lower runs first.', null=True, verbose_name='turn')),
                ('urgent_from', models.DateTimeField(blank=True, null=True, verbose_name='goes before others from')),
                ('state', models.CharField(choices=[('queued', 'queued'), ('running', 'on track'), ('finished', 'finished'), ('failed', 'failed'), ('stopped', 'stopped')], default='queued', max_length=8, verbose_name='state')),
                ('progress', models.JSONField(blank=True, default=dict, verbose_name='progress')),
                ('queued_at', models.DateTimeField(default=django.utils.timezone.now, verbose_name='queued')),
                ('owner', models.ForeignKey(on_delete=django.db.models.deletion.CASCADE, related_name='evaluations', to=settings.AUTH_USER_MODEL, verbose_name='owner')),
                ('track', models.ForeignKey(on_delete=django.db.models.deletion.PROTECT, related_name='evaluations', to='tracks.track', verbose_name='track')),
            ],
            options={
                'verbose_name': 'evaluation',
                'verbose_name_plural': 'evaluations',
                'ordering': ['-queued_at', '-pk'],
            },
        ),
        migrations.CreateModel(
            name='Network',
            fields=[
                ('sha256', models.CharField(max_length=64, primary_key=True, serialize=False, verbose_name='sha-256')),
                ('onnx', models.FileField(upload_to='networks/', verbose_name='canonical ONNX')),
                ('size', models.PositiveIntegerField(verbose_name='bytes')),
                ('parameters', models.PositiveIntegerField(verbose_name='weights')),
                ('macs', models.PositiveBigIntegerField(verbose_name='multiplications a step')),
                ('facts', models.JSONField(blank=True, help_text='What its admission found out of its arithmetic. Empty: it is found out at each start.', null=True, verbose_name='facts')),
                ('created_at', models.DateTimeField(default=django.utils.timezone.now, verbose_name='first seen')),
            ],
            options={
                'verbose_name': 'network',
                'verbose_name_plural': 'networks',
                'constraints': [models.CheckConstraint(condition=models.Q(('sha256__regex', '^[0-9a-f]{64}$')), name='network_sha256_form')],
            },
        ),
        migrations.CreateModel(
            name='Result',
            fields=[
                ('id', models.BigAutoField(auto_created=True, primary_key=True, serialize=False, verbose_name='ID')),
                ('laps', models.JSONField(verbose_name='laps')),
                ('trajectory', models.JSONField(default=list, verbose_name='trajectory')),
                ('end_reason', models.CharField(max_length=32, verbose_name='ended because')),
                ('retired_code', models.CharField(blank=True, max_length=40, verbose_name='retired because')),
                ('retired_params', models.JSONField(blank=True, default=dict, verbose_name='details')),
                ('complete_laps', models.PositiveSmallIntegerField(verbose_name='complete laps')),
                ('best_lap_ms', models.PositiveIntegerField(blank=True, null=True, verbose_name='best lap')),
                ('total_ms', models.PositiveIntegerField(verbose_name='total')),
                ('off_tracks', models.PositiveIntegerField(default=0, verbose_name='off tracks')),
                ('crashes', models.PositiveIntegerField(default=0, verbose_name='crashes')),
                ('resets', models.PositiveIntegerField(default=0, verbose_name='resets')),
                ('trace', models.FileField(upload_to='traces/', verbose_name='trace')),
                ('trace_sha256', models.CharField(max_length=64, verbose_name='sha-256 of the trace')),
                ('metrics', models.JSONField(verbose_name='metrics')),
                ('lease', models.UUIDField(default=uuid.uuid4, editable=False, verbose_name='lease')),
                ('order', models.JSONField(default=evaluation.models.alone, verbose_name='order')),
                ('layout', models.JSONField(blank=True, default=dict, verbose_name='layout')),
                ('bots', models.FileField(blank=True, upload_to='traces/', verbose_name='bot cars')),
                ('simulated_ms', models.PositiveIntegerField(verbose_name='simulated')),
                ('wall_s', models.FloatField(verbose_name='wall seconds')),
                ('peak_mb', models.FloatField(verbose_name='peak memory')),
                ('engine', models.CharField(max_length=32, verbose_name='engine')),
                ('versions', models.JSONField(verbose_name='library versions')),
                ('cpu_model', models.CharField(blank=True, max_length=128, verbose_name='processor')),
                ('created_at', models.DateTimeField(default=django.utils.timezone.now, verbose_name='recorded')),
                ('evaluation', models.OneToOneField(on_delete=django.db.models.deletion.CASCADE, related_name='result', to='evaluation.evaluation', verbose_name='evaluation')),
            ],
            options={
                'verbose_name': 'result',
                'verbose_name_plural': 'results',
                'abstract': False,
            },
        ),
        migrations.CreateModel(
            name='RivalResult',
            fields=[
                ('id', models.BigAutoField(auto_created=True, primary_key=True, serialize=False, verbose_name='ID')),
                ('laps', models.JSONField(verbose_name='laps')),
                ('trajectory', models.JSONField(default=list, verbose_name='trajectory')),
                ('end_reason', models.CharField(max_length=32, verbose_name='ended because')),
                ('retired_code', models.CharField(blank=True, max_length=40, verbose_name='retired because')),
                ('retired_params', models.JSONField(blank=True, default=dict, verbose_name='details')),
                ('complete_laps', models.PositiveSmallIntegerField(verbose_name='complete laps')),
                ('best_lap_ms', models.PositiveIntegerField(blank=True, null=True, verbose_name='best lap')),
                ('total_ms', models.PositiveIntegerField(verbose_name='total')),
                ('off_tracks', models.PositiveIntegerField(default=0, verbose_name='off tracks')),
                ('crashes', models.PositiveIntegerField(default=0, verbose_name='crashes')),
                ('resets', models.PositiveIntegerField(default=0, verbose_name='resets')),
                ('trace', models.FileField(upload_to='traces/', verbose_name='trace')),
                ('trace_sha256', models.CharField(max_length=64, verbose_name='sha-256 of the trace')),
                ('metrics', models.JSONField(verbose_name='metrics')),
                ('number', models.PositiveSmallIntegerField(verbose_name='number')),
                ('result', models.ForeignKey(on_delete=django.db.models.deletion.CASCADE, related_name='rivals', to='evaluation.result', verbose_name='result')),
            ],
            options={
                'verbose_name': 'result of a rival',
                'verbose_name_plural': 'results of rivals',
                'ordering': ['result', 'number'],
                'abstract': False,
            },
        ),
        migrations.CreateModel(
            name='StoredFile',
            fields=[
                ('name', models.CharField(max_length=255, primary_key=True, serialize=False, verbose_name='name')),
                ('sha256', models.CharField(blank=True, max_length=64, verbose_name='sha-256')),
                ('size', models.PositiveBigIntegerField(verbose_name='bytes')),
                ('checked_at', models.DateTimeField(blank=True, db_index=True, null=True, verbose_name='checked')),
                ('damage', models.CharField(blank=True, choices=[('missing', 'missing'), ('altered', 'altered')], max_length=8, verbose_name='damage')),
                ('damaged_at', models.DateTimeField(blank=True, null=True, verbose_name='found damaged')),
            ],
            options={
                'verbose_name': 'stored file',
                'verbose_name_plural': 'stored files',
                'indexes': [models.Index(condition=models.Q(('damage', ''), _negated=True), fields=['damaged_at'], name='storedfile_damaged')],
                'constraints': [models.CheckConstraint(condition=models.Q(('sha256__regex', '^[0-9a-f]{64}$'), models.Q(('sha256', ''), models.Q(('damage', ''), _negated=True)), _connector='OR'), name='storedfile_sha256_form'), models.CheckConstraint(condition=models.Q(models.Q(('damage', ''), ('damaged_at__isnull', True)), models.Q(('damage__in', ['missing', 'altered']), ('damaged_at__isnull', False)), _connector='OR'), name='storedfile_damage_has_time')],
            },
        ),
        migrations.CreateModel(
            name='TrainedModel',
            fields=[
                ('id', models.BigAutoField(auto_created=True, primary_key=True, serialize=False, verbose_name='ID')),
                ('public_id', models.CharField(default=core.ids.new_public_id, editable=False, max_length=12, unique=True)),
                ('name', models.CharField(max_length=64, verbose_name='name')),
                ('description', models.CharField(blank=True, max_length=255, verbose_name='description')),
                ('metadata', models.JSONField(verbose_name='model metadata')),
                ('shell', models.CharField(choices=[('paddock', 'Paddock'), ('formula', 'Formula'), ('coupe', 'Coupé'), ('hatch', 'Hatchback'), ('buggy', 'Buggy'), ('kart', 'Kart'), ('pickup', 'Pick-up'), ('van', 'Van'), ('wagon', 'Estate'), ('rover', 'Rover'), ('roadster', 'Roadster'), ('wedge', 'Wedge')], default='paddock', max_length=16, verbose_name='shell')),
                ('colour', models.CharField(default='#3b82f6', max_length=7, verbose_name='colour')),
                ('source_kind', models.CharField(max_length=16, verbose_name='uploaded as')),
                ('source_sha256', models.CharField(max_length=64, verbose_name='sha-256 of the upload')),
                ('created_at', models.DateTimeField(default=django.utils.timezone.now, verbose_name='uploaded')),
                ('deleted_at', models.DateTimeField(blank=True, null=True, verbose_name='deleted')),
                ('shared_at', models.DateTimeField(blank=True, null=True, verbose_name='shared')),
                ('network', models.ForeignKey(on_delete=django.db.models.deletion.PROTECT, related_name='models', to='evaluation.network', verbose_name='network')),
                ('owner', models.ForeignKey(on_delete=django.db.models.deletion.CASCADE, related_name='models', to=settings.AUTH_USER_MODEL, verbose_name='owner')),
            ],
            options={
                'verbose_name': 'model',
                'verbose_name_plural': 'models',
                'ordering': ['-created_at', '-pk'],
            },
        ),
        migrations.CreateModel(
            name='EvaluationRival',
            fields=[
                ('id', models.BigAutoField(auto_created=True, primary_key=True, serialize=False, verbose_name='ID')),
                ('number', models.PositiveSmallIntegerField(verbose_name='number')),
                ('metadata', models.JSONField(verbose_name='model metadata')),
                ('evaluation', models.ForeignKey(on_delete=django.db.models.deletion.CASCADE, related_name='rivals', to='evaluation.evaluation', verbose_name='evaluation')),
                ('model', models.ForeignKey(on_delete=django.db.models.deletion.PROTECT, related_name='rival_evaluations', to='evaluation.trainedmodel', verbose_name='model')),
            ],
            options={
                'verbose_name': 'rival',
                'verbose_name_plural': 'rivals',
                'ordering': ['evaluation', 'number'],
            },
        ),
        migrations.AddField(
            model_name='evaluation',
            name='model',
            field=models.ForeignKey(on_delete=django.db.models.deletion.PROTECT, related_name='evaluations', to='evaluation.trainedmodel', verbose_name='model'),
        ),
        migrations.AddConstraint(
            model_name='result',
            constraint=models.CheckConstraint(condition=models.Q(('trace_sha256__regex', '^[0-9a-f]{64}$')), name='result_trace_sha256_form'),
        ),
        migrations.AddConstraint(
            model_name='result',
            constraint=models.CheckConstraint(condition=models.Q(models.Q(('best_lap_ms__isnull', True), ('complete_laps', 0)), models.Q(('best_lap_ms__gt', 0), ('best_lap_ms__isnull', False), ('complete_laps__gt', 0)), _connector='OR'), name='result_best_lap_needs_a_lap'),
        ),
        migrations.AddConstraint(
            model_name='result',
            constraint=models.CheckConstraint(condition=models.Q(models.Q(('end_reason', 'retired'), models.Q(('retired_code', ''), _negated=True)), models.Q(models.Q(('end_reason', 'retired'), _negated=True), ('retired_code', '')), _connector='OR'), name='result_retired_for_a_reason'),
        ),
        migrations.AddConstraint(
            model_name='rivalresult',
            constraint=models.CheckConstraint(condition=models.Q(('trace_sha256__regex', '^[0-9a-f]{64}$')), name='rivalresult_trace_sha256_form'),
        ),
        migrations.AddConstraint(
            model_name='rivalresult',
            constraint=models.CheckConstraint(condition=models.Q(models.Q(('best_lap_ms__isnull', True), ('complete_laps', 0)), models.Q(('best_lap_ms__gt', 0), ('best_lap_ms__isnull', False), ('complete_laps__gt', 0)), _connector='OR'), name='rivalresult_best_lap_needs_a_lap'),
        ),
        migrations.AddConstraint(
            model_name='rivalresult',
            constraint=models.CheckConstraint(condition=models.Q(models.Q(('end_reason', 'retired'), models.Q(('retired_code', ''), _negated=True)), models.Q(models.Q(('end_reason', 'retired'), _negated=True), ('retired_code', '')), _connector='OR'), name='rivalresult_retired_for_a_reason'),
        ),
        migrations.AddConstraint(
            model_name='rivalresult',
            constraint=models.UniqueConstraint(fields=('result', 'number'), name='rivalresult_number_unique'),
        ),
        migrations.AddConstraint(
            model_name='rivalresult',
            constraint=models.CheckConstraint(condition=models.Q(('number__gte', 1), ('number__lt', 4)), name='rivalresult_number_in_range'),
        ),
        migrations.AddIndex(
            model_name='trainedmodel',
            index=models.Index(condition=models.Q(('shared_at__isnull', False)), fields=['-shared_at', '-id'], name='model_shared'),
        ),
        migrations.AddConstraint(
            model_name='trainedmodel',
            constraint=models.CheckConstraint(condition=models.Q(('deleted_at', None), ('shared_at', None), _connector='OR'), name='model_deleted_is_not_shared'),
        ),
        migrations.AddConstraint(
            model_name='trainedmodel',
            constraint=models.UniqueConstraint(condition=models.Q(('deleted_at', None)), fields=('owner', 'network'), name='model_uploaded_once_by_owner'),
        ),
        migrations.AddConstraint(
            model_name='trainedmodel',
            constraint=models.UniqueConstraint(condition=models.Q(('deleted_at', None)), fields=('owner', 'name'), name='model_name_unique_for_owner'),
        ),
        migrations.AddConstraint(
            model_name='trainedmodel',
            constraint=models.CheckConstraint(condition=models.Q(('shell__in', ['paddock', 'formula', 'coupe', 'hatch', 'buggy', 'kart', 'pickup', 'van', 'wagon', 'rover', 'roadster', 'wedge'])), name='model_shell_known'),
        ),
        migrations.AddConstraint(
            model_name='trainedmodel',
            constraint=models.CheckConstraint(condition=models.Q(('colour__regex', '^#[0-9a-f]{6}$')), name='model_colour_form'),
        ),
        migrations.AddConstraint(
            model_name='trainedmodel',
            constraint=models.CheckConstraint(condition=models.Q(('source_sha256__regex', '^[0-9a-f]{64}$')), name='model_source_sha256_form'),
        ),
        migrations.AddConstraint(
            model_name='trainedmodel',
            constraint=models.CheckConstraint(condition=models.Q(('source_kind__in', ['onnx', 'tensorflow', 'sb3'])), name='model_source_kind_known'),
        ),
        migrations.AddConstraint(
            model_name='evaluationrival',
            constraint=models.UniqueConstraint(fields=('evaluation', 'number'), name='rival_number_unique'),
        ),
        migrations.AddConstraint(
            model_name='evaluationrival',
            constraint=models.CheckConstraint(condition=models.Q(('number__gte', 1), ('number__lt', 4)), name='rival_number_in_range'),
        ),
        migrations.AddConstraint(
            model_name='evaluationrival',
            constraint=models.CheckConstraint(condition=models.Q(('metadata', {}), _negated=True), name='rival_has_metadata'),
        ),
        migrations.AddIndex(
            model_name='evaluation',
            index=models.Index(condition=models.Q(('state', 'queued')), fields=['-priority', 'turn', 'queued_at', 'id'], name='evaluation_in_turn'),
        ),
        migrations.AddIndex(
            model_name='evaluation',
            index=models.Index(condition=models.Q(('not_before__isnull', True), ('state', 'queued')), fields=['-priority', 'turn', 'queued_at', 'id'], name='evaluation_ready'),
        ),
        migrations.AddIndex(
            model_name='evaluation',
            index=models.Index(condition=models.Q(('not_before__isnull', False)), fields=['not_before'], name='evaluation_pausing'),
        ),
        migrations.AddIndex(
            model_name='evaluation',
            index=models.Index(condition=models.Q(('state', 'queued'), ('urgent_from__isnull', False)), fields=['urgent_from'], name='evaluation_urgent_from'),
        ),
        migrations.AddIndex(
            model_name='evaluation',
            index=models.Index(condition=models.Q(('priority__gt', -20), ('state', 'queued')), fields=['queued_at'], name='evaluation_waiting_since'),
        ),
        migrations.AddIndex(
            model_name='evaluation',
            index=models.Index(condition=models.Q(('started_at__isnull', False)), fields=['priority', 'turn'], name='evaluation_round_begun'),
        ),
        migrations.AddIndex(
            model_name='evaluation',
            index=models.Index(condition=models.Q(('started_at__isnull', False)), fields=['owner', 'priority', 'turn'], name='evaluation_turns_begun'),
        ),
        migrations.AddIndex(
            model_name='evaluation',
            index=models.Index(condition=models.Q(('state', 'running')), fields=['priority'], name='evaluation_running'),
        ),
        migrations.AddIndex(
            model_name='evaluation',
            index=models.Index(condition=models.Q(('state', 'queued'), ('turn__isnull', True)), fields=['priority'], name='evaluation_without_turn'),
        ),
        migrations.AddIndex(
            model_name='evaluation',
            index=models.Index(condition=models.Q(('state', 'running')), fields=['leased_until'], name='evaluation_leases'),
        ),
        migrations.AddIndex(
            model_name='evaluation',
            index=models.Index(condition=models.Q(('ended_at__isnull', False)), fields=['ended_at'], name='evaluation_by_end'),
        ),
        migrations.AddConstraint(
            model_name='evaluation',
            constraint=models.CheckConstraint(condition=models.Q(('state__in', ['queued', 'running', 'finished', 'failed', 'stopped'])), name='evaluation_state_known'),
        ),
        migrations.AddConstraint(
            model_name='evaluation',
            constraint=models.CheckConstraint(condition=models.Q(models.Q(('lease__isnull', False), ('leased_until__isnull', False), ('started_at__isnull', False), ('state', 'running')), models.Q(models.Q(('state', 'running'), _negated=True), ('lease__isnull', True), ('leased_until__isnull', True)), _connector='OR'), name='evaluation_lease_while_running'),
        ),
        migrations.AddConstraint(
            model_name='evaluation',
            constraint=models.CheckConstraint(condition=models.Q(models.Q(('ended_at__isnull', False), ('state__in', ['finished', 'failed', 'stopped'])), models.Q(('ended_at__isnull', True), ('state__in', ['queued', 'running'])), _connector='OR'), name='evaluation_ended_when_final'),
        ),
        migrations.AddConstraint(
            model_name='evaluation',
            constraint=models.CheckConstraint(condition=models.Q(('not_before__isnull', True), ('state', 'queued'), _connector='OR'), name='evaluation_pauses_while_queued'),
        ),
        migrations.AddConstraint(
            model_name='evaluation',
            constraint=models.CheckConstraint(condition=models.Q(models.Q(('state', 'failed'), _negated=True), models.Q(('reason_code', ''), _negated=True), _connector='OR'), name='evaluation_failure_has_reason'),
        ),
        migrations.AddConstraint(
            model_name='evaluation',
            constraint=models.CheckConstraint(condition=models.Q(('not_before__isnull', True), ('failed_at__isnull', False), _connector='OR'), name='evaluation_pauses_after_our_fault'),
        ),
        migrations.AddConstraint(
            model_name='evaluation',
            constraint=models.CheckConstraint(condition=models.Q(('kills__lte', models.F('attempt'))), name='evaluation_kills_of_attempts'),
        ),
        migrations.AddConstraint(
            model_name='evaluation',
            constraint=models.UniqueConstraint(condition=models.Q(('state', 'queued')), fields=('owner', 'priority', 'turn'), name='evaluation_one_in_a_turn'),
        ),
    ]
