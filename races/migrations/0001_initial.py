import django.core.validators
import django.db.models.deletion
import django.db.models.expressions
import django.db.models.functions.comparison
import django.db.models.lookups
import django.utils.timezone
import races.models.layout
import races.models.race
import races.models.rules
from django.conf import settings
from django.db import migrations, models


class Migration(migrations.Migration):

    initial = True

    dependencies = [
        ('evaluation', '0001_initial'),
        ('tracks', '0001_initial'),
        migrations.swappable_dependency(settings.AUTH_USER_MODEL),
    ]

    operations = [
        migrations.CreateModel(
            name='Race',
            fields=[
                ('id', models.BigAutoField(auto_created=True, primary_key=True, serialize=False, verbose_name='ID')),
                ('rules', models.JSONField(blank=True, db_default={}, default=races.models.rules.inside_a_race, editable=False, verbose_name='other rules')),
                ('race_type', models.CharField(choices=[('time_trial', 'time trial'), ('object_avoidance', 'object avoidance'), ('head_to_head', 'head-to-head')], default='time_trial', max_length=16, verbose_name='Race type')),
                ('laps', models.PositiveSmallIntegerField(default=3, validators=[django.core.validators.MinValueValidator(1), django.core.validators.MaxValueValidator(20)], verbose_name='Laps driven')),
                ('off_track_penalty_ms', models.PositiveIntegerField(default=2000, help_text='The car stands still for so long before it goes on.', validators=[django.core.validators.MaxValueValidator(60000)], verbose_name='Off-track penalty in milliseconds')),
                ('collision_penalty_ms', models.PositiveIntegerField(default=5000, help_text='For running into a box, a bot or another car.', validators=[django.core.validators.MaxValueValidator(60000)], verbose_name='Collision penalty in milliseconds')),
                ('max_resets', models.PositiveIntegerField(default=10000, help_text='0: the first fault ends the run.', validators=[django.core.validators.MaxValueValidator(10000)], verbose_name='Resets allowed')),
                ('max_simulated_ms', models.PositiveIntegerField(default=180000, help_text='Simulated time for the whole run.', validators=[django.core.validators.MinValueValidator(10000), django.core.validators.MaxValueValidator(1200000)], verbose_name='Time limit in milliseconds')),
                ('seed', models.PositiveIntegerField(default=0, help_text='Another number, other draws; the same number, the same for everybody.', validators=[django.core.validators.MaxValueValidator(2147483647)], verbose_name='Seed')),
                ('direction', models.CharField(choices=[('ccw', 'counter-clockwise'), ('cw', 'clockwise')], default='ccw', max_length=3, verbose_name='Direction')),
                ('boxes', models.JSONField(blank=True, default=list, help_text='Percentages of the lap from the finish line, in the direction driven.', verbose_name='Boxes')),
                ('random_boxes', models.PositiveSmallIntegerField(default=0, verbose_name='How many boxes')),
                ('box_distance_m', models.FloatField(default=2.0, verbose_name='Metres between boxes at least')),
                ('bots', models.PositiveSmallIntegerField(default=0, verbose_name='How many bots')),
                ('bot_speed_mps', models.FloatField(default=1.0, verbose_name='Their speed in m/s')),
                ('sensors', models.JSONField(default=races.models.rules.default_sensors, help_text='Only models that read no others can be sent.', verbose_name='Sensors offered')),
                ('ranking_method', models.CharField(choices=[('average', 'average lap'), ('best', 'best lap'), ('total', 'total time')], default='average', max_length=7, verbose_name='Ranked by')),
                ('minimum_laps', models.PositiveSmallIntegerField(default=3, help_text='The average is taken over this many consecutive complete laps.', validators=[django.core.validators.MinValueValidator(1), django.core.validators.MaxValueValidator(20)], verbose_name='Laps in a row to be classified')),
                ('max_submissions', models.PositiveSmallIntegerField(default=50, validators=[django.core.validators.MinValueValidator(1), django.core.validators.MaxValueValidator(1000)], verbose_name='Submissions for each racer')),
                ('shared_cars', models.BooleanField(db_default=False, default=False, help_text='For teams and classes. Otherwise whoever sent a car first keeps its place.', verbose_name='One car may race for several racers')),
                ('opponents', models.CharField(blank=True, choices=[('bots', 'bot cars'), ('models', "the other racers' cars")], default='', max_length=6, verbose_name='Opponents')),
                ('duel_format', models.CharField(blank=True, choices=[('round_robin', 'round robin'), ('bracket', 'bracket')], default='', max_length=11, verbose_name='Duels')),
                ('duel_cars', models.PositiveSmallIntegerField(default=2, verbose_name='Cars on the track at once')),
                ('slug', models.SlugField(max_length=80, unique=True, verbose_name='address')),
                ('kind', models.CharField(choices=[('league', 'league'), ('community', 'community')], default='community', max_length=9, verbose_name='kind')),
                ('division', models.CharField(blank=True, choices=[('open', 'open division'), ('pro', 'pro division'), ('all', 'all divisions')], max_length=4, verbose_name='division')),
                ('name', models.CharField(max_length=64, validators=[django.core.validators.RegexValidator('^[^\\x00-\\x1f\\x7f]*\\S[^\\x00-\\x1f\\x7f]*\\Z', 'Write a name on one line.', code='one_line')], verbose_name='name')),
                ('description', models.TextField(blank=True, max_length=2000, verbose_name='description')),
                ('visibility', models.CharField(choices=[('public', 'public'), ('invitation', 'by invitation link')], default='public', max_length=10, verbose_name='visibility')),
                ('invitation', models.CharField(default=races.models.race.new_invitation, editable=False, max_length=32, unique=True, verbose_name='invitation')),
                ('opens_at', models.DateTimeField(verbose_name='opens')),
                ('closes_at', models.DateTimeField(verbose_name='closes')),
                ('cancelled_at', models.DateTimeField(blank=True, editable=False, null=True, verbose_name='cancelled')),
                ('cancel_reason', models.CharField(blank=True, editable=False, max_length=255, verbose_name='reason for cancelling')),
                ('created_at', models.DateTimeField(default=django.utils.timezone.now, editable=False, verbose_name='created')),
                ('imported_at', models.DateTimeField(blank=True, editable=False, help_text='Driven elsewhere: its results came as a record, without submissions.', null=True, verbose_name='imported')),
                ('fastest_lap_ms', models.PositiveIntegerField(blank=True, editable=False, null=True, verbose_name='fastest lap')),
                ('fastest_sector_1_ms', models.PositiveIntegerField(blank=True, editable=False, null=True, verbose_name='fastest sector 1')),
                ('fastest_sector_2_ms', models.PositiveIntegerField(blank=True, editable=False, null=True, verbose_name='fastest sector 2')),
                ('fastest_sector_3_ms', models.PositiveIntegerField(blank=True, editable=False, null=True, verbose_name='fastest sector 3')),
                ('engine', models.CharField(blank=True, editable=False, max_length=32, verbose_name='engine')),
                ('next_engine', models.CharField(blank=True, editable=False, help_text='The engine that all counted runs are being driven again with; empty when none are.', max_length=32, verbose_name='driven again with')),
                ('organiser', models.ForeignKey(blank=True, null=True, on_delete=django.db.models.deletion.SET_NULL, related_name='organised_races', to=settings.AUTH_USER_MODEL, verbose_name='organiser')),
                ('track', models.ForeignKey(on_delete=django.db.models.deletion.PROTECT, related_name='races', to='tracks.track', verbose_name='track')),
            ],
            options={
                'verbose_name': 'race',
                'verbose_name_plural': 'races',
                'ordering': ['-opens_at', 'pk'],
            },
        ),
        migrations.CreateModel(
            name='Draw',
            fields=[
                ('race', models.OneToOneField(on_delete=django.db.models.deletion.CASCADE, primary_key=True, related_name='draw', serialize=False, to='races.race', verbose_name='race')),
                ('entrants', models.PositiveSmallIntegerField(verbose_name='cars drawn')),
                ('drawn_at', models.DateTimeField(verbose_name='drawn')),
                ('over_at', models.DateTimeField(blank=True, null=True, verbose_name='last duel decided')),
            ],
            options={
                'verbose_name': 'draw',
                'verbose_name_plural': 'draws',
            },
        ),
        migrations.CreateModel(
            name='BoardCount',
            fields=[
                ('id', models.BigAutoField(auto_created=True, primary_key=True, serialize=False, verbose_name='ID')),
                ('shift', models.SmallIntegerField()),
                ('bucket', models.BigIntegerField()),
                ('rows', models.IntegerField(default=0)),
                ('racers', models.IntegerField(default=0)),
                ('race', models.ForeignKey(db_index=False, on_delete=django.db.models.deletion.CASCADE, related_name='board_counts', to='races.race')),
            ],
            options={
                'verbose_name': 'count of a board',
                'verbose_name_plural': 'counts of boards',
            },
        ),
        migrations.CreateModel(
            name='Duel',
            fields=[
                ('id', models.BigAutoField(auto_created=True, primary_key=True, serialize=False, verbose_name='ID')),
                ('round', models.PositiveSmallIntegerField(verbose_name='round')),
                ('number', models.PositiveSmallIntegerField(verbose_name='number')),
                ('state', models.CharField(choices=[('waiting', 'scheduled'), ('driving', 'in the queue or on track'), ('decided', 'decided'), ('void', 'not driven: Paddock failed')], default='waiting', max_length=8, verbose_name='state')),
                ('tries', models.PositiveSmallIntegerField(default=0, verbose_name='runs')),
                ('decided_at', models.DateTimeField(blank=True, null=True, verbose_name='decided')),
                ('evaluation', models.OneToOneField(blank=True, null=True, on_delete=django.db.models.deletion.PROTECT, related_name='duel', to='evaluation.evaluation', verbose_name='evaluation')),
                ('race', models.ForeignKey(db_index=False, on_delete=django.db.models.deletion.CASCADE, related_name='duels', to='races.race', verbose_name='race')),
            ],
            options={
                'verbose_name': 'duel',
                'verbose_name_plural': 'duels',
                'ordering': ['race', 'round', 'number'],
            },
        ),
        migrations.CreateModel(
            name='Entry',
            fields=[
                ('id', models.BigAutoField(auto_created=True, primary_key=True, serialize=False, verbose_name='ID')),
                ('entered_at', models.DateTimeField(default=django.utils.timezone.now, verbose_name='entered')),
                ('withdrawn_at', models.DateTimeField(blank=True, null=True, verbose_name='withdrawn')),
                ('removed_at', models.DateTimeField(blank=True, null=True, verbose_name='removed by the organiser')),
                ('removal_reason', models.CharField(blank=True, max_length=255, verbose_name='reason for removing')),
                ('is_baseline', models.BooleanField(default=False, verbose_name='house car, outside the ranking')),
                ('submission_count', models.PositiveSmallIntegerField(default=0, help_text='Those that count: refunded ones are taken off again.', verbose_name='submissions')),
                ('last_number', models.PositiveSmallIntegerField(default=0, help_text='Only grows: a refunded submission keeps its number.', verbose_name='last submission number')),
                ('classified', models.BooleanField(default=False, verbose_name='classified')),
                ('score_ms', models.PositiveIntegerField(blank=True, null=True, verbose_name='score')),
                ('average_ms', models.PositiveIntegerField(blank=True, null=True, verbose_name='average lap')),
                ('best_lap_ms', models.PositiveIntegerField(blank=True, null=True, verbose_name='best lap')),
                ('total_ms', models.PositiveIntegerField(blank=True, null=True, verbose_name='total')),
                ('complete_laps', models.PositiveSmallIntegerField(default=0, verbose_name='complete laps')),
                ('off_tracks', models.PositiveIntegerField(default=0, verbose_name='off tracks')),
                ('crashes', models.PositiveIntegerField(default=0, verbose_name='crashes')),
                ('resets', models.PositiveIntegerField(default=0, verbose_name='resets')),
                ('sectors', models.JSONField(blank=True, default=list, verbose_name="best lap's sectors")),
                ('achieved_at', models.DateTimeField(blank=True, null=True, verbose_name='submitted')),
                ('rank_score', models.BigIntegerField(default=2000000000000, verbose_name='ranked by, first')),
                ('rank_lap', models.PositiveIntegerField(default=2147483647, verbose_name='ranked by, second')),
                ('seed', models.PositiveSmallIntegerField(blank=True, help_text='The place in qualifying when the duels were drawn.', null=True, verbose_name='seed')),
                ('points', models.PositiveSmallIntegerField(default=0, verbose_name='points')),
                ('duels', models.PositiveSmallIntegerField(default=0, verbose_name='duels')),
                ('duel_lap_ms', models.PositiveIntegerField(blank=True, null=True, verbose_name='average lap in duels')),
                ('own_lap_ms', models.PositiveIntegerField(blank=True, null=True, verbose_name='own fastest lap')),
                ('own_sector_1_ms', models.PositiveIntegerField(blank=True, null=True, verbose_name='own fastest sector 1')),
                ('own_sector_2_ms', models.PositiveIntegerField(blank=True, null=True, verbose_name='own fastest sector 2')),
                ('own_sector_3_ms', models.PositiveIntegerField(blank=True, null=True, verbose_name='own fastest sector 3')),
                ('car_of', models.ForeignKey(blank=True, editable=False, help_text='Without a result of its own, because its car is that of this entry, which sent it before.', null=True, on_delete=django.db.models.deletion.SET_NULL, related_name='+', to='races.entry', verbose_name='car of')),
                ('race', models.ForeignKey(db_index=False, on_delete=django.db.models.deletion.CASCADE, related_name='entries', to='races.race', verbose_name='race')),
                ('racer', models.ForeignKey(on_delete=django.db.models.deletion.CASCADE, related_name='entries', to=settings.AUTH_USER_MODEL, verbose_name='racer')),
            ],
            options={
                'verbose_name': 'entry',
                'verbose_name_plural': 'entries',
            },
        ),
        migrations.CreateModel(
            name='DuelCompetitor',
            fields=[
                ('id', models.BigAutoField(auto_created=True, primary_key=True, serialize=False, verbose_name='ID')),
                ('grid', models.PositiveSmallIntegerField(verbose_name='starting place')),
                ('forfeited', models.BooleanField(default=False, verbose_name='did not start')),
                ('place', models.PositiveSmallIntegerField(blank=True, null=True, verbose_name='place')),
                ('points', models.PositiveSmallIntegerField(blank=True, null=True, verbose_name='points')),
                ('laps', models.PositiveSmallIntegerField(default=0, verbose_name='complete laps')),
                ('time_ms', models.PositiveIntegerField(default=0, verbose_name='their time')),
                ('retired_code', models.CharField(blank=True, max_length=40, verbose_name='retired because')),
                ('duel', models.ForeignKey(db_index=False, on_delete=django.db.models.deletion.CASCADE, related_name='cars', to='races.duel', verbose_name='duel')),
                ('entry', models.ForeignKey(on_delete=django.db.models.deletion.CASCADE, related_name='duel_cars', to='races.entry', verbose_name='entry')),
            ],
            options={
                'verbose_name': 'car in a duel',
                'verbose_name_plural': 'cars in duels',
                'ordering': ['duel', 'grid'],
            },
        ),
        migrations.CreateModel(
            name='RaceCar',
            fields=[
                ('id', models.BigAutoField(auto_created=True, primary_key=True, serialize=False, verbose_name='ID')),
                ('car', models.CharField(max_length=64, verbose_name='car')),
                ('entry', models.ForeignKey(on_delete=django.db.models.deletion.CASCADE, related_name='cars', to='races.entry', verbose_name='entry')),
                ('race', models.ForeignKey(db_index=False, on_delete=django.db.models.deletion.CASCADE, related_name='cars', to='races.race', verbose_name='race')),
            ],
            options={
                'verbose_name': 'car of a race',
                'verbose_name_plural': 'cars of a race',
            },
        ),
        migrations.CreateModel(
            name='RefusedCar',
            fields=[
                ('id', models.BigAutoField(auto_created=True, primary_key=True, serialize=False, verbose_name='ID')),
                ('at', models.DateTimeField(verbose_name='last tried')),
                ('same_file', models.BooleanField(help_text='The very network that is in the race, not another that answers the same.', verbose_name='to the byte')),
                ('car', models.ForeignKey(db_index=False, on_delete=django.db.models.deletion.CASCADE, related_name='refused', to='races.racecar', verbose_name='car')),
                ('racer', models.ForeignKey(on_delete=django.db.models.deletion.CASCADE, related_name='refused_cars', to=settings.AUTH_USER_MODEL, verbose_name='racer')),
            ],
            options={
                'verbose_name': 'refused car',
                'verbose_name_plural': 'refused cars',
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
                ('entry', models.ForeignKey(db_index=False, on_delete=django.db.models.deletion.CASCADE, related_name='retimings', to='races.entry', verbose_name='entry')),
            ],
            options={
                'verbose_name': 'changed time',
                'verbose_name_plural': 'changed times',
            },
        ),
        migrations.CreateModel(
            name='Submission',
            fields=[
                ('id', models.BigAutoField(auto_created=True, primary_key=True, serialize=False, verbose_name='ID')),
                ('number', models.PositiveSmallIntegerField(verbose_name='number')),
                ('submitted_at', models.DateTimeField(default=django.utils.timezone.now, verbose_name='submitted')),
                ('is_void', models.BooleanField(default=False, help_text='Ended without a verdict on the car, which may be sent again.', verbose_name='void')),
                ('refunded', models.BooleanField(default=False, help_text='Does not count among the submissions that the race allows.', verbose_name='refunded')),
                ('car_of', models.ForeignKey(blank=True, editable=False, help_text='Who sent this very car to the race before: it does not count for anybody else.', null=True, on_delete=django.db.models.deletion.SET_NULL, related_name='+', to='races.entry', verbose_name='car of')),
                ('entry', models.ForeignKey(db_index=False, on_delete=django.db.models.deletion.CASCADE, related_name='submissions', to='races.entry', verbose_name='entry')),
                ('evaluation', models.OneToOneField(on_delete=django.db.models.deletion.PROTECT, related_name='submission', to='evaluation.evaluation', verbose_name='evaluation')),
                ('network', models.ForeignKey(on_delete=django.db.models.deletion.PROTECT, related_name='+', to='evaluation.network', verbose_name='network')),
            ],
            options={
                'verbose_name': 'submission',
                'verbose_name_plural': 'submissions',
                'ordering': ['-submitted_at', '-pk'],
            },
        ),
        migrations.CreateModel(
            name='Redrive',
            fields=[
                ('id', models.BigAutoField(auto_created=True, primary_key=True, serialize=False, verbose_name='ID')),
                ('engine', models.CharField(max_length=32, verbose_name='engine')),
                ('tries', models.PositiveSmallIntegerField(default=1, verbose_name='runs')),
                ('state', models.CharField(choices=[('pending', 'under way'), ('taken', 'taken'), ('dropped', 'dropped')], default='pending', max_length=8, verbose_name='state')),
                ('evaluation', models.OneToOneField(on_delete=django.db.models.deletion.PROTECT, related_name='redrive', to='evaluation.evaluation', verbose_name='evaluation')),
                ('replaced', models.OneToOneField(blank=True, null=True, on_delete=django.db.models.deletion.PROTECT, related_name='replaced_by', to='evaluation.evaluation', verbose_name='evaluation before')),
                ('submission', models.ForeignKey(db_index=False, on_delete=django.db.models.deletion.CASCADE, related_name='redrives', to='races.submission', verbose_name='submission')),
            ],
            options={
                'verbose_name': 'run driven again',
                'verbose_name_plural': 'runs driven again',
            },
        ),
        migrations.AddField(
            model_name='entry',
            name='best',
            field=models.ForeignKey(blank=True, null=True, on_delete=django.db.models.deletion.SET_NULL, related_name='+', to='races.submission', verbose_name='best submission'),
        ),
        migrations.AddIndex(
            model_name='race',
            index=models.Index(fields=['closes_at', 'opens_at'], name='race_by_time'),
        ),
        migrations.AddIndex(
            model_name='race',
            index=models.Index(condition=models.Q(('cancelled_at__isnull', False)), fields=['cancelled_at'], name='race_by_cancelling'),
        ),
        migrations.AddIndex(
            model_name='race',
            index=models.Index(condition=models.Q(('next_engine', ''), _negated=True), fields=['next_engine'], name='race_driven_again'),
        ),
        migrations.AddConstraint(
            model_name='race',
            constraint=models.CheckConstraint(condition=models.Q(('closes_at__gt', models.F('opens_at'))), name='race_closes_after_opening'),
        ),
        migrations.AddConstraint(
            model_name='race',
            constraint=models.CheckConstraint(condition=models.Q(('minimum_laps__gte', 1), ('minimum_laps__lte', models.F('laps'))), name='race_minimum_laps_within_laps'),
        ),
        migrations.AddConstraint(
            model_name='race',
            constraint=models.CheckConstraint(condition=models.Q(('max_submissions__gte', 1)), name='race_allows_a_submission'),
        ),
        migrations.AddConstraint(
            model_name='race',
            constraint=models.CheckConstraint(condition=models.Q(('max_simulated_ms__gte', 10000), ('max_simulated_ms__lte', 1200000)), name='race_time_limit_range'),
        ),
        migrations.AddConstraint(
            model_name='race',
            constraint=models.CheckConstraint(condition=models.Q(('imported_at__isnull', False), models.Q(('laps__gte', 1), ('laps__lte', 20)), _connector='OR'), name='race_laps_range'),
        ),
        migrations.AddConstraint(
            model_name='race',
            constraint=models.CheckConstraint(condition=models.Q(('imported_at__isnull', False), models.Q(('ranking_method', 'total'), _negated=True), ('minimum_laps', models.F('laps')), _connector='OR'), name='race_total_needs_all_laps'),
        ),
        migrations.AddConstraint(
            model_name='race',
            constraint=models.CheckConstraint(condition=models.Q(('imported_at__isnull', False), models.Q(('off_track_penalty_ms__gte', 0), ('off_track_penalty_ms__lte', 60000), ('collision_penalty_ms__gte', 0), ('collision_penalty_ms__lte', 60000)), _connector='OR'), name='race_penalty_range'),
        ),
        migrations.AddConstraint(
            model_name='race',
            constraint=models.CheckConstraint(condition=models.Q(('imported_at__isnull', False), models.Q(('race_type', 'time_trial'), ('boxes', []), ('random_boxes', 0), ('bots', 0), ('duel_format', ''), ('opponents', '')), models.Q(('race_type', 'object_avoidance'), models.Q(('boxes', []), ('random_boxes', 0), _negated=True), ('bots', 0), ('duel_format', ''), ('opponents', '')), models.Q(('race_type', 'head_to_head'), ('boxes', []), ('random_boxes', 0), models.Q(('opponents', ''), _negated=True)), _connector='OR'), name='race_type_has_its_own_options'),
        ),
        migrations.AddConstraint(
            model_name='race',
            constraint=models.CheckConstraint(condition=models.Q(('imported_at__isnull', False), models.Q(('boxes', []), ('random_boxes__lte', 10)), models.Q(('random_boxes', 0), models.Q(('boxes', []), _negated=True)), _connector='OR'), name='race_boxes_are_fixed_or_drawn'),
        ),
        migrations.AddConstraint(
            model_name='race',
            constraint=models.CheckConstraint(condition=models.Q(('imported_at__isnull', False), django.db.models.lookups.LessThanOrEqual(races.models.layout._Length('boxes'), 10), _connector='OR'), name='race_box_count'),
        ),
        migrations.AddConstraint(
            model_name='race',
            constraint=models.CheckConstraint(condition=models.Q(('imported_at__isnull', False), models.Q(('box_distance_m__gte', 0.5), ('box_distance_m__lte', 20.0)), _connector='OR'), name='race_box_distance_range'),
        ),
        migrations.AddConstraint(
            model_name='race',
            constraint=models.CheckConstraint(condition=models.Q(('imported_at__isnull', False), models.Q(('bots', 0), ('duel_format', ''), ('opponents', '')), models.Q(('bots__gte', 1), ('bots__lte', 6), ('duel_format', ''), ('opponents', 'bots')), models.Q(('bots', 0), ('duel_format', 'round_robin'), ('opponents', 'models')), models.Q(('bots', 0), ('duel_cars', 2), ('duel_format', 'bracket'), ('opponents', 'models')), _connector='OR'), name='race_opponents_are_bots_or_models'),
        ),
        migrations.AddConstraint(
            model_name='race',
            constraint=models.CheckConstraint(condition=models.Q(('imported_at__isnull', False), models.Q(('bot_speed_mps__gte', 0.2), ('bot_speed_mps__lte', 4.0)), _connector='OR'), name='race_bot_speed_range'),
        ),
        migrations.AddConstraint(
            model_name='race',
            constraint=models.CheckConstraint(condition=models.Q(('imported_at__isnull', False), models.Q(('duel_cars__gte', 2), ('duel_cars__lte', 4)), _connector='OR'), name='race_duel_cars_range'),
        ),
        migrations.AddConstraint(
            model_name='race',
            constraint=models.CheckConstraint(condition=models.Q(('next_engine', ''), models.Q(('engine', ''), _negated=True), _connector='OR'), name='race_driven_again_was_driven'),
        ),
        migrations.AddConstraint(
            model_name='race',
            constraint=models.CheckConstraint(condition=models.Q(models.Q(('kind', 'league'), models.Q(('division', ''), _negated=True), ('visibility', 'public')), models.Q(('division', ''), ('kind', 'community')), _connector='OR'), name='race_league_has_division_and_is_public'),
        ),
        migrations.AddConstraint(
            model_name='boardcount',
            constraint=models.UniqueConstraint(fields=('race', 'shift', 'bucket'), name='board_count_once_a_bucket'),
        ),
        migrations.AddConstraint(
            model_name='duel',
            constraint=models.UniqueConstraint(fields=('race', 'round', 'number'), name='duel_once_in_a_round'),
        ),
        migrations.AddConstraint(
            model_name='duel',
            constraint=models.CheckConstraint(condition=models.Q(('number__gte', 1), ('round__gte', 1)), name='duel_numbered_from_one'),
        ),
        migrations.AddConstraint(
            model_name='duel',
            constraint=models.CheckConstraint(condition=models.Q(('state__in', ['waiting', 'driving', 'decided', 'void'])), name='duel_state_known'),
        ),
        migrations.AddConstraint(
            model_name='duel',
            constraint=models.CheckConstraint(condition=models.Q(models.Q(('decided_at__isnull', False), ('state__in', ['decided', 'void'])), models.Q(('decided_at', None), ('state__in', ['waiting', 'driving'])), _connector='OR'), name='duel_decided_when_final'),
        ),
        migrations.AddConstraint(
            model_name='duel',
            constraint=models.CheckConstraint(condition=models.Q(models.Q(('state__in', ['driving', 'void']), _negated=True), models.Q(('evaluation__isnull', False), ('tries__gte', 1)), _connector='OR'), name='duel_drives_an_evaluation'),
        ),
        migrations.AddConstraint(
            model_name='duelcompetitor',
            constraint=models.UniqueConstraint(fields=('duel', 'entry'), name='duelcompetitor_once_in_a_duel'),
        ),
        migrations.AddConstraint(
            model_name='duelcompetitor',
            constraint=models.UniqueConstraint(fields=('duel', 'grid'), name='duelcompetitor_grid_once'),
        ),
        migrations.AddConstraint(
            model_name='duelcompetitor',
            constraint=models.UniqueConstraint(condition=models.Q(('place', None), _negated=True), fields=('duel', 'place'), name='duelcompetitor_place_once'),
        ),
        migrations.AddConstraint(
            model_name='duelcompetitor',
            constraint=models.CheckConstraint(condition=models.Q(('grid__gte', 1), ('grid__lte', 4)), name='duelcompetitor_grid_range'),
        ),
        migrations.AddConstraint(
            model_name='duelcompetitor',
            constraint=models.CheckConstraint(condition=models.Q(models.Q(('laps', 0), ('place', None), ('points', None), ('retired_code', ''), ('time_ms', 0)), models.Q(('place__isnull', False), ('points__isnull', False), ('place__gte', 1), ('place__lte', 4), ('points__lte', django.db.models.expressions.CombinedExpression(models.Value(4), '-', models.F('place')))), _connector='OR'), name='duelcompetitor_points_with_a_place'),
        ),
        migrations.AddConstraint(
            model_name='duelcompetitor',
            constraint=models.CheckConstraint(condition=models.Q(models.Q(('forfeited', False), ('retired_code', '')), ('points', None), ('points', 0), _connector='OR'), name='duelcompetitor_lost_without_points'),
        ),
        migrations.AddConstraint(
            model_name='racecar',
            constraint=models.UniqueConstraint(fields=('race', 'car'), name='racecar_once_in_a_race'),
        ),
        migrations.AddConstraint(
            model_name='racecar',
            constraint=models.CheckConstraint(condition=models.Q(('car__regex', '^[0-9a-f]{64}$')), name='racecar_car_form'),
        ),
        migrations.AddConstraint(
            model_name='refusedcar',
            constraint=models.UniqueConstraint(fields=('car', 'racer'), name='refusedcar_once_for_a_racer'),
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
        migrations.AddConstraint(
            model_name='submission',
            constraint=models.UniqueConstraint(fields=('entry', 'number'), name='submission_number_once'),
        ),
        migrations.AddConstraint(
            model_name='submission',
            constraint=models.UniqueConstraint(condition=models.Q(('is_void', False)), fields=('entry', 'network'), name='submission_of_a_car_once'),
        ),
        migrations.AddConstraint(
            model_name='submission',
            constraint=models.CheckConstraint(condition=models.Q(('refunded', False), ('is_void', True), _connector='OR'), name='submission_refunded_is_void'),
        ),
        migrations.AddConstraint(
            model_name='submission',
            constraint=models.CheckConstraint(condition=models.Q(('car_of', None), models.Q(('car_of', models.F('entry')), _negated=True), _connector='OR'), name='submission_is_no_copy_of_its_own'),
        ),
        migrations.AddConstraint(
            model_name='submission',
            constraint=models.CheckConstraint(condition=models.Q(('number__gte', 1)), name='submission_number_from_one'),
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
            model_name='entry',
            index=models.Index(condition=models.Q(('withdrawn_at', None)), fields=['race', 'rank_score', 'rank_lap', 'resets', 'achieved_at', 'id', 'is_baseline'], name='entry_board'),
        ),
        migrations.AddConstraint(
            model_name='entry',
            constraint=models.UniqueConstraint(fields=('race', 'racer'), name='entry_once_in_a_race'),
        ),
        migrations.AddConstraint(
            model_name='entry',
            constraint=models.CheckConstraint(condition=models.Q(models.Q(('classified', False), ('rank_score__gte', 999999000000), ('score_ms__isnull', True)), models.Q(('classified', True), ('rank_lap', models.F('best_lap_ms')), ('rank_score', models.F('score_ms')), ('seed', None)), models.Q(('classified', True), ('rank_lap', django.db.models.expressions.CombinedExpression(django.db.models.expressions.CombinedExpression(django.db.models.functions.comparison.Coalesce('duel_lap_ms', 2000000), '*', models.Value(128)), '+', models.F('seed'))), ('rank_score', django.db.models.expressions.CombinedExpression(models.Value(-1), '-', models.F('points'))), ('seed__isnull', False)), _connector='OR'), name='entry_rank_follows_standing'),
        ),
        migrations.AddConstraint(
            model_name='entry',
            constraint=models.CheckConstraint(condition=models.Q(models.Q(('classified', False), ('seed', None)), models.Q(('achieved_at__isnull', False), ('classified', True), ('score_ms__isnull', False)), _connector='OR'), name='entry_classified_has_a_score'),
        ),
        migrations.AddConstraint(
            model_name='entry',
            constraint=models.CheckConstraint(condition=models.Q(models.Q(('duel_lap_ms', None), ('duels', 0), ('points', 0), ('seed', None)), models.Q(('seed__gte', 1), ('seed__lt', 128), models.Q(('duel_lap_ms', None), ('duel_lap_ms__lt', 2000000), _connector='OR')), _connector='OR'), name='entry_seed_range'),
        ),
        migrations.AddConstraint(
            model_name='entry',
            constraint=models.UniqueConstraint(condition=models.Q(('seed', None), _negated=True), fields=('race', 'seed'), name='entry_seed_once_in_a_race'),
        ),
        migrations.AddConstraint(
            model_name='entry',
            constraint=models.CheckConstraint(condition=models.Q(('removed_at__isnull', True), ('withdrawn_at__isnull', False), _connector='OR'), name='entry_removed_is_withdrawn'),
        ),
        migrations.AddConstraint(
            model_name='entry',
            constraint=models.CheckConstraint(condition=models.Q(('submission_count__lte', models.F('last_number'))), name='entry_counts_numbered_submissions'),
        ),
    ]
