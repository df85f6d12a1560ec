import core.ids
import django.core.validators
import django.db.models.deletion
import django.utils.timezone
import training.models.vehicle
from django.conf import settings
from django.db import migrations, models


class Migration(migrations.Migration):

    initial = True

    dependencies = [
        ('evaluation', '0001_initial'),
        ('races', '0001_initial'),
        ('tracks', '0001_initial'),
        migrations.swappable_dependency(settings.AUTH_USER_MODEL),
    ]

    operations = [
        migrations.CreateModel(
            name='Vehicle',
            fields=[
                ('id', models.BigAutoField(auto_created=True, primary_key=True, serialize=False, verbose_name='ID')),
                ('public_id', models.CharField(default=core.ids.new_public_id, editable=False, max_length=12, unique=True)),
                ('name', models.CharField(max_length=64, verbose_name='name')),
                ('sensors', models.JSONField(default=training.models.vehicle.default_sensors, verbose_name='sensors')),
                ('lidar_config', models.JSONField(blank=True, default=dict, verbose_name='lidar settings')),
                ('neural_network', models.CharField(choices=[('DEEP_CONVOLUTIONAL_NETWORK_SHALLOW', 'shallow'), ('DEEP_CONVOLUTIONAL_NETWORK', 'middle'), ('DEEP_CONVOLUTIONAL_NETWORK_DEEP', 'deep')], default='DEEP_CONVOLUTIONAL_NETWORK_SHALLOW', max_length=40, verbose_name='network')),
                ('shell', models.CharField(choices=[('paddock', 'Paddock'), ('formula', 'Formula'), ('coupe', 'Coupé'), ('hatch', 'Hatchback'), ('buggy', 'Buggy'), ('kart', 'Kart'), ('pickup', 'Pick-up'), ('van', 'Van'), ('wagon', 'Estate'), ('rover', 'Rover'), ('roadster', 'Roadster'), ('wedge', 'Wedge')], default='paddock', max_length=16, verbose_name='shell')),
                ('colour', models.CharField(default='#3b82f6', max_length=7, validators=[django.core.validators.RegexValidator('^#[0-9a-f]{6}$')], verbose_name='colour')),
                ('created_at', models.DateTimeField(default=django.utils.timezone.now, editable=False, verbose_name='added')),
                ('owner', models.ForeignKey(on_delete=django.db.models.deletion.CASCADE, related_name='vehicles', to=settings.AUTH_USER_MODEL, verbose_name='owner')),
            ],
            options={
                'verbose_name': 'vehicle',
                'verbose_name_plural': 'vehicles',
                'ordering': ['name', 'pk'],
            },
        ),
        migrations.CreateModel(
            name='TrainingJob',
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
                ('name', models.CharField(max_length=64, verbose_name='name')),
                ('description', models.CharField(blank=True, max_length=255, verbose_name='description')),
                ('direction', models.CharField(choices=[('ccw', 'counter-clockwise'), ('cw', 'clockwise')], default='ccw', max_length=3, verbose_name='Direction')),
                ('race_type', models.CharField(choices=[('time_trial', 'time trial'), ('object_avoidance', 'object avoidance'), ('head_to_head', 'head-to-head')], default='time_trial', max_length=16, verbose_name='Race type')),
                ('boxes', models.JSONField(blank=True, default=list, help_text='Percentages of the lap from the finish line, in the direction driven.', verbose_name='Boxes')),
                ('random_boxes', models.PositiveSmallIntegerField(default=0, verbose_name='How many boxes')),
                ('bots', models.PositiveSmallIntegerField(default=0, verbose_name='How many bots')),
                ('bot_speed_mps', models.FloatField(default=1.0, verbose_name='Their speed in m/s')),
                ('bot_lane_changes', models.BooleanField(db_default=False, default=False, help_text='At moments drawn from the seed.', verbose_name='They change lanes')),
                ('algorithm', models.CharField(choices=[('ppo', 'PPO'), ('sac', 'SAC')], default='ppo', max_length=3, verbose_name='algorithm')),
                ('hyperparameters', models.JSONField(verbose_name='hyperparameters')),
                ('action_space_type', models.CharField(max_length=10, verbose_name='kind of action space')),
                ('action_space', models.JSONField(verbose_name='action space')),
                ('sensors', models.JSONField(verbose_name='sensors')),
                ('lidar_config', models.JSONField(blank=True, default=dict, verbose_name='lidar settings')),
                ('neural_network', models.CharField(choices=[('DEEP_CONVOLUTIONAL_NETWORK_SHALLOW', 'shallow'), ('DEEP_CONVOLUTIONAL_NETWORK', 'middle'), ('DEEP_CONVOLUTIONAL_NETWORK_DEEP', 'deep')], max_length=40, verbose_name='network')),
                ('shell', models.CharField(choices=[('paddock', 'Paddock'), ('formula', 'Formula'), ('coupe', 'Coupé'), ('hatch', 'Hatchback'), ('buggy', 'Buggy'), ('kart', 'Kart'), ('pickup', 'Pick-up'), ('van', 'Van'), ('wagon', 'Estate'), ('rover', 'Rover'), ('roadster', 'Roadster'), ('wedge', 'Wedge')], default='paddock', max_length=16, verbose_name='shell')),
                ('colour', models.CharField(default='#3b82f6', max_length=7, verbose_name='colour')),
                ('reward_code', models.TextField(verbose_name='reward function')),
                ('reward_signature', models.CharField(choices=[('params', 'reward_function(params)'), ('positional', 'the 2018 form with separate values')], default='params', max_length=10, verbose_name='form of the reward function')),
                ('stop_minutes', models.PositiveSmallIntegerField(default=10, help_text='Of wall time: 1 to 1440.', validators=[django.core.validators.MinValueValidator(1), django.core.validators.MaxValueValidator(1440)], verbose_name='Minutes at most')),
                ('stop_steps', models.PositiveIntegerField(blank=True, help_text='Fifteen steps are one second of driving.', null=True, validators=[django.core.validators.MinValueValidator(1), django.core.validators.MaxValueValidator(2147483647)], verbose_name='Steps')),
                ('stop_clean_laps', models.PositiveSmallIntegerField(blank=True, help_text='It ends as soon as the car has driven so many without leaving the road.', null=True, validators=[django.core.validators.MinValueValidator(1), django.core.validators.MaxValueValidator(10)], verbose_name='Clean laps in a row')),
                ('trials', models.PositiveSmallIntegerField(default=3, help_text='After each update the car drives so many laps without exploring.', validators=[django.core.validators.MinValueValidator(1), django.core.validators.MaxValueValidator(10)], verbose_name='Trials of an evaluation')),
                ('best_metric', models.CharField(choices=[('progress', 'progress'), ('reward', 'reward'), ('lap_time', 'lap time')], default='progress', help_text='What makes one of these evaluations the best; its model is kept beside the last one.', max_length=8, verbose_name='Best by')),
                ('seed', models.PositiveIntegerField(default=0, verbose_name='seed')),
                ('state', models.CharField(choices=[('queued', 'queued'), ('running', 'training'), ('finished', 'finished'), ('failed', 'failed'), ('stopped', 'stopped')], default='queued', max_length=8, verbose_name='state')),
                ('stop_asked_at', models.DateTimeField(blank=True, null=True, verbose_name='asked to stop')),
                ('progress', models.JSONField(blank=True, default=dict, verbose_name='progress')),
                ('driving', models.JSONField(blank=True, default=list, verbose_name='newest drive')),
                ('steps_done', models.PositiveIntegerField(default=0, verbose_name='steps driven')),
                ('seconds_done', models.FloatField(default=0.0, verbose_name='seconds of training')),
                ('charged_s', models.FloatField(db_default=0.0, default=0.0, help_text="From each claim to its end, by the database's clock; of lost attempts what a checkpoint has kept.", verbose_name='seconds charged')),
                ('failures', models.PositiveSmallIntegerField(db_default=0, default=0, help_text='Faults of ours in a row, since it last got further.', verbose_name='failures')),
                ('got_to', models.PositiveIntegerField(db_default=0, default=0, help_text='The iteration of its newest checkpoint when it last failed.', verbose_name='got to')),
                ('sb3_zip', models.FileField(blank=True, upload_to='training/', verbose_name='stable-baselines3 model')),
                ('log', models.TextField(blank=True, verbose_name='log')),
                ('printed', models.TextField(blank=True, verbose_name='newest lines that the reward function printed')),
                ('submit_reason_code', models.CharField(blank=True, max_length=40, verbose_name='not submitted because')),
                ('submit_reason_params', models.JSONField(blank=True, default=dict, verbose_name='details')),
                ('ended_because', models.CharField(blank=True, choices=[('time', 'its minutes were used up'), ('steps', 'it had driven its steps'), ('clean_laps', 'it lapped cleanly'), ('stopped', 'it was stopped'), ('failed', 'it failed')], max_length=10, verbose_name='why it ended')),
                ('created_at', models.DateTimeField(default=django.utils.timezone.now, verbose_name='made')),
                ('deleted_at', models.DateTimeField(blank=True, help_text='Its row stays until its month is over, for its minutes count.', null=True, verbose_name='deleted')),
                ('best_model', models.ForeignKey(blank=True, null=True, on_delete=django.db.models.deletion.SET_NULL, related_name='best_of_jobs', to='evaluation.trainedmodel', verbose_name='best model')),
                ('cloned_from', models.ForeignKey(blank=True, null=True, on_delete=django.db.models.deletion.PROTECT, related_name='clones', to='evaluation.trainedmodel', verbose_name='cloned from')),
                ('last_model', models.ForeignKey(blank=True, null=True, on_delete=django.db.models.deletion.SET_NULL, related_name='last_of_jobs', to='evaluation.trainedmodel', verbose_name='last model')),
                ('owner', models.ForeignKey(on_delete=django.db.models.deletion.CASCADE, related_name='training_jobs', to=settings.AUTH_USER_MODEL, verbose_name='owner')),
                ('stopped_by', models.ForeignKey(blank=True, null=True, on_delete=django.db.models.deletion.SET_NULL, related_name='+', to=settings.AUTH_USER_MODEL, verbose_name='stopped by')),
                ('submission', models.OneToOneField(blank=True, null=True, on_delete=django.db.models.deletion.SET_NULL, related_name='training_job', to='races.submission', verbose_name='submission')),
                ('submit_to_race', models.ForeignKey(blank=True, null=True, on_delete=django.db.models.deletion.SET_NULL, related_name='training_jobs', to='races.race', verbose_name='race to submit to')),
                ('track', models.ForeignKey(on_delete=django.db.models.deletion.PROTECT, related_name='training_jobs', to='tracks.track', verbose_name='track')),
                ('vehicle', models.ForeignKey(blank=True, null=True, on_delete=django.db.models.deletion.SET_NULL, related_name='jobs', to='training.vehicle', verbose_name='vehicle')),
            ],
            options={
                'verbose_name': 'training job',
                'verbose_name_plural': 'training jobs',
                'ordering': ['-created_at', '-pk'],
            },
        ),
        migrations.CreateModel(
            name='TrainingIteration',
            fields=[
                ('id', models.BigAutoField(auto_created=True, primary_key=True, serialize=False, verbose_name='ID')),
                ('number', models.PositiveIntegerField(verbose_name='number')),
                ('steps', models.PositiveIntegerField(verbose_name='steps so far')),
                ('seconds', models.FloatField(verbose_name='seconds so far')),
                ('steps_per_second', models.FloatField(default=0.0, verbose_name='steps a second')),
                ('episodes', models.JSONField(default=list, verbose_name='episodes')),
                ('mean_reward', models.FloatField(null=True, verbose_name='mean reward of an episode')),
                ('mean_progress', models.FloatField(null=True, verbose_name='mean progress of an episode in percent')),
                ('eval_trials', models.JSONField(default=list, verbose_name='trials of the evaluation')),
                ('eval_progress', models.FloatField(verbose_name='mean progress of the evaluation in percent')),
                ('eval_reward', models.FloatField(verbose_name='mean reward of the evaluation')),
                ('eval_lap_ms', models.PositiveIntegerField(null=True, verbose_name='mean lap of the evaluation')),
                ('eval_clean_laps', models.PositiveSmallIntegerField(default=0, verbose_name='clean laps of the evaluation')),
                ('entropy', models.FloatField(null=True, verbose_name='entropy')),
                ('policy_loss', models.FloatField(null=True, verbose_name='policy loss')),
                ('value_loss', models.FloatField(null=True, verbose_name='value loss')),
                ('is_best', models.BooleanField(default=False, verbose_name='best so far')),
                ('simtrace', models.FileField(blank=True, upload_to='training/', verbose_name='sim-trace')),
                ('job', models.ForeignKey(on_delete=django.db.models.deletion.CASCADE, related_name='iterations', to='training.trainingjob', verbose_name='training job')),
            ],
            options={
                'verbose_name': 'iteration',
                'verbose_name_plural': 'iterations',
                'ordering': ['job', 'number'],
                'constraints': [models.UniqueConstraint(fields=('job', 'number'), name='iteration_number_unique_in_job'), models.CheckConstraint(condition=models.Q(('eval_progress__gte', 0), ('eval_progress__lte', 100)), name='iteration_progress_is_percent')],
            },
        ),
        migrations.CreateModel(
            name='Checkpoint',
            fields=[
                ('id', models.BigAutoField(auto_created=True, primary_key=True, serialize=False, verbose_name='ID')),
                ('iteration', models.PositiveIntegerField(verbose_name='iteration')),
                ('steps', models.PositiveIntegerField(verbose_name='steps so far')),
                ('seconds', models.FloatField(verbose_name='seconds so far')),
                ('file', models.FileField(upload_to='training/', verbose_name='state')),
                ('networks', models.FileField(blank=True, upload_to='training/', verbose_name='networks')),
                ('created_at', models.DateTimeField(default=django.utils.timezone.now, verbose_name='written')),
                ('job', models.ForeignKey(on_delete=django.db.models.deletion.CASCADE, related_name='checkpoints', to='training.trainingjob', verbose_name='training job')),
            ],
            options={
                'verbose_name': 'checkpoint',
                'verbose_name_plural': 'checkpoints',
                'ordering': ['job', '-iteration'],
                'constraints': [models.UniqueConstraint(fields=('job', 'iteration'), name='checkpoint_unique_in_job')],
            },
        ),
        migrations.AddConstraint(
            model_name='vehicle',
            constraint=models.UniqueConstraint(fields=('owner', 'name'), name='vehicle_name_unique_for_owner'),
        ),
        migrations.AddConstraint(
            model_name='vehicle',
            constraint=models.CheckConstraint(condition=models.Q(('name', ''), _negated=True), name='vehicle_has_a_name'),
        ),
        migrations.AddConstraint(
            model_name='vehicle',
            constraint=models.CheckConstraint(condition=models.Q(('colour__regex', '^#[0-9a-f]{6}$')), name='vehicle_colour_form'),
        ),
        migrations.AddConstraint(
            model_name='vehicle',
            constraint=models.CheckConstraint(condition=models.Q(('shell__in', ['paddock', 'formula', 'coupe', 'hatch', 'buggy', 'kart', 'pickup', 'van', 'wagon', 'rover', 'roadster', 'wedge'])), name='vehicle_shell_known'),
        ),
        migrations.AddConstraint(
            model_name='vehicle',
            constraint=models.CheckConstraint(condition=models.Q(('neural_network__in', ['DEEP_CONVOLUTIONAL_NETWORK_SHALLOW', 'DEEP_CONVOLUTIONAL_NETWORK', 'DEEP_CONVOLUTIONAL_NETWORK_DEEP'])), name='vehicle_network_known'),
        ),
        migrations.AddConstraint(
            model_name='vehicle',
            constraint=models.CheckConstraint(condition=models.Q(('sensors', []), _negated=True), name='vehicle_has_sensors'),
        ),
        migrations.AddIndex(
            model_name='trainingjob',
            index=models.Index(condition=models.Q(('state', 'queued')), fields=['created_at', 'id'], name='training_queue'),
        ),
        migrations.AddIndex(
            model_name='trainingjob',
            index=models.Index(condition=models.Q(('state', 'running')), fields=['leased_until'], name='training_leases'),
        ),
        migrations.AddConstraint(
            model_name='trainingjob',
            constraint=models.CheckConstraint(condition=models.Q(('state__in', ['queued', 'running', 'finished', 'failed', 'stopped'])), name='training_state_known'),
        ),
        migrations.AddConstraint(
            model_name='trainingjob',
            constraint=models.CheckConstraint(condition=models.Q(models.Q(('lease__isnull', False), ('leased_until__isnull', False), ('started_at__isnull', False), ('state', 'running')), models.Q(models.Q(('state', 'running'), _negated=True), ('lease__isnull', True), ('leased_until__isnull', True)), _connector='OR'), name='training_lease_while_running'),
        ),
        migrations.AddConstraint(
            model_name='trainingjob',
            constraint=models.CheckConstraint(condition=models.Q(models.Q(('ended_at__isnull', False), ('state__in', ['finished', 'failed', 'stopped'])), models.Q(('ended_at__isnull', True), ('state__in', ['queued', 'running'])), _connector='OR'), name='training_ended_when_final'),
        ),
        migrations.AddConstraint(
            model_name='trainingjob',
            constraint=models.CheckConstraint(condition=models.Q(('not_before__isnull', True), ('state', 'queued'), _connector='OR'), name='training_pauses_while_queued'),
        ),
        migrations.AddConstraint(
            model_name='trainingjob',
            constraint=models.UniqueConstraint(condition=models.Q(('state__in', ['queued', 'running'])), fields=('owner', 'name'), name='training_name_unique_while_it_runs'),
        ),
        migrations.AddConstraint(
            model_name='trainingjob',
            constraint=models.CheckConstraint(condition=models.Q(('name__regex', '^[A-Za-z0-9-]{1,64}$')), name='training_name_form'),
        ),
        migrations.AddConstraint(
            model_name='trainingjob',
            constraint=models.CheckConstraint(condition=models.Q(models.Q(('ended_because', ''), ('state__in', ['queued', 'running'])), models.Q(('ended_because__in', ['time', 'steps', 'clean_laps']), ('state', 'finished')), models.Q(('ended_because', 'stopped'), ('state', 'stopped')), models.Q(('ended_because', 'failed'), ('state', 'failed')), _connector='OR'), name='training_end_has_reason'),
        ),
        migrations.AddConstraint(
            model_name='trainingjob',
            constraint=models.CheckConstraint(condition=models.Q(models.Q(('state', 'failed'), _negated=True), models.Q(('reason_code', ''), _negated=True), _connector='OR'), name='training_failure_has_reason'),
        ),
        migrations.AddConstraint(
            model_name='trainingjob',
            constraint=models.CheckConstraint(condition=models.Q(models.Q(('state', 'finished'), _negated=True), ('steps_done__gt', 0), _connector='OR'), name='training_finished_has_steps'),
        ),
        migrations.AddConstraint(
            model_name='trainingjob',
            constraint=models.CheckConstraint(condition=models.Q(models.Q(('bots', 0), ('boxes', []), ('race_type', 'time_trial'), ('random_boxes', 0)), models.Q(('bots', 0), ('boxes', []), ('race_type', 'object_avoidance'), ('random_boxes__gte', 1), ('random_boxes__lte', 10)), models.Q(('bots', 0), ('race_type', 'object_avoidance'), ('random_boxes', 0), models.Q(('boxes', []), _negated=True)), models.Q(('bots__gte', 1), ('bots__lte', 6), ('boxes', []), ('race_type', 'head_to_head'), ('random_boxes', 0)), _connector='OR'), name='training_race_type_options'),
        ),
        migrations.AddConstraint(
            model_name='trainingjob',
            constraint=models.CheckConstraint(condition=models.Q(('bot_speed_mps__gte', 0.2), ('bot_speed_mps__lte', 4.0)), name='training_bot_speed_range'),
        ),
        migrations.AddConstraint(
            model_name='trainingjob',
            constraint=models.CheckConstraint(condition=models.Q(models.Q(('action_space_type__in', ['discrete', 'continuous']), ('algorithm', 'ppo')), models.Q(('action_space_type', 'continuous'), ('algorithm', 'sac')), _connector='OR'), name='training_algorithm_takes_action_space'),
        ),
        migrations.AddConstraint(
            model_name='trainingjob',
            constraint=models.CheckConstraint(condition=models.Q(('stop_minutes__gte', 1), ('stop_minutes__lte', 1440)), name='training_minutes_range'),
        ),
        migrations.AddConstraint(
            model_name='trainingjob',
            constraint=models.CheckConstraint(condition=models.Q(('stop_steps__isnull', True), ('stop_steps__gte', 1), _connector='OR'), name='training_steps_positive'),
        ),
        migrations.AddConstraint(
            model_name='trainingjob',
            constraint=models.CheckConstraint(condition=models.Q(('stop_clean_laps__isnull', True), models.Q(('stop_clean_laps__gte', 1), ('stop_clean_laps__lte', 10)), _connector='OR'), name='training_clean_laps_range'),
        ),
        migrations.AddConstraint(
            model_name='trainingjob',
            constraint=models.CheckConstraint(condition=models.Q(('trials__gte', 1), ('trials__lte', 10)), name='training_trials_range'),
        ),
        migrations.AddConstraint(
            model_name='trainingjob',
            constraint=models.CheckConstraint(condition=models.Q(('best_metric__in', ['progress', 'reward', 'lap_time'])), name='training_best_metric_known'),
        ),
        migrations.AddConstraint(
            model_name='trainingjob',
            constraint=models.CheckConstraint(condition=models.Q(('reward_code', ''), _negated=True), name='training_has_reward_function'),
        ),
        migrations.AddConstraint(
            model_name='trainingjob',
            constraint=models.CheckConstraint(condition=models.Q(('charged_s__gte', 0)), name='training_charged_seconds_positive'),
        ),
        migrations.AddConstraint(
            model_name='trainingjob',
            constraint=models.CheckConstraint(condition=models.Q(('deleted_at__isnull', True), models.Q(('best_model', None), ('last_model', None), ('log', ''), ('sb3_zip', ''), ('state__in', ['finished', 'failed', 'stopped'])), _connector='OR'), name='training_deleted_leaves_nothing'),
        ),
    ]
