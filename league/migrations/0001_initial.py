import django.core.validators
import django.db.models.deletion
import django.utils.timezone
import league.models.season
import league.models.webhook
import races.models.rules
from decimal import Decimal
from django.conf import settings
from django.db import migrations, models


class Migration(migrations.Migration):

    initial = True

    dependencies = [
        ('accounts', '0001_initial'),
        ('races', '0001_initial'),
        migrations.swappable_dependency(settings.AUTH_USER_MODEL),
    ]

    operations = [
        migrations.CreateModel(
            name='NoticeChoice',
            fields=[
                ('racer', models.OneToOneField(on_delete=django.db.models.deletion.CASCADE, primary_key=True, related_name='notice_choice', serialize=False, to=settings.AUTH_USER_MODEL)),
                ('site_off', models.JSONField(blank=True, default=list, verbose_name='not in the site')),
                ('mail_off', models.JSONField(blank=True, default=list, verbose_name='not by e-mail')),
                ('language', models.CharField(choices=[('en', 'English'), ('ko', 'Korean')], default='en', max_length=5, verbose_name='language of e-mails')),
            ],
            options={
                'verbose_name': 'choice of notices',
                'verbose_name_plural': 'choices of notices',
            },
        ),
        migrations.CreateModel(
            name='WebhookHost',
            fields=[
                ('host', models.CharField(max_length=255, primary_key=True, serialize=False, verbose_name='host')),
                ('failures', models.PositiveSmallIntegerField(default=0, verbose_name='failures in a row')),
                ('free_at', models.DateTimeField(verbose_name='free at')),
            ],
            options={
                'verbose_name': 'host of webhooks',
                'verbose_name_plural': 'hosts of webhooks',
            },
        ),
        migrations.CreateModel(
            name='Lead',
            fields=[
                ('race', models.OneToOneField(on_delete=django.db.models.deletion.CASCADE, primary_key=True, related_name='lead_seen', serialize=False, to='races.race')),
                ('racer', models.ForeignKey(on_delete=django.db.models.deletion.CASCADE, related_name='+', to=settings.AUTH_USER_MODEL)),
            ],
            options={
                'verbose_name': 'lead',
                'verbose_name_plural': 'leads',
            },
        ),
        migrations.CreateModel(
            name='Notice',
            fields=[
                ('id', models.BigAutoField(auto_created=True, primary_key=True, serialize=False, verbose_name='ID')),
                ('kind', models.CharField(choices=[('opens', 'a race opens'), ('closes', 'a race closes in a day'), ('result', 'a result is in'), ('lost_lead', 'the lead is lost'), ('promoted', 'promoted'), ('finale', 'in the finale'), ('qualified', 'qualified for the championship'), ('official', 'results are official'), ('message', 'a word from the organisers'), ('cancelled', 'a race is cancelled'), ('disqualified', 'disqualified by the stewards'), ('restored', 'put back by the stewards'), ('retimed', 'a new engine changed your time')], max_length=12, verbose_name='kind')),
                ('about', models.CharField(max_length=160, verbose_name='about')),
                ('params', models.JSONField(blank=True, default=dict, verbose_name='what it says')),
                ('path', models.CharField(blank=True, max_length=200, verbose_name='leads to')),
                ('at', models.DateTimeField(verbose_name='at')),
                ('hidden', models.BooleanField(default=False, verbose_name='by mail only')),
                ('read_at', models.DateTimeField(blank=True, null=True, verbose_name='read')),
                ('racer', models.ForeignKey(db_index=False, on_delete=django.db.models.deletion.CASCADE, related_name='notices', to=settings.AUTH_USER_MODEL, verbose_name='racer')),
            ],
            options={
                'verbose_name': 'notice',
                'verbose_name_plural': 'notices',
                'ordering': ['-at', '-pk'],
            },
        ),
        migrations.CreateModel(
            name='Mail',
            fields=[
                ('id', models.BigAutoField(auto_created=True, primary_key=True, serialize=False, verbose_name='ID')),
                ('attempt', models.PositiveSmallIntegerField(db_default=0, default=0, verbose_name='attempt')),
                ('lease', models.UUIDField(blank=True, editable=False, null=True, verbose_name='lease')),
                ('leased_until', models.DateTimeField(blank=True, null=True, verbose_name='leased until')),
                ('worker', models.CharField(blank=True, db_default='', default='', max_length=128, verbose_name='worker')),
                ('not_before', models.DateTimeField(blank=True, null=True, verbose_name='pauses until')),
                ('started_at', models.DateTimeField(blank=True, null=True, verbose_name='started')),
                ('ended_at', models.DateTimeField(blank=True, null=True, verbose_name='ended')),
                ('state', models.CharField(default='due', max_length=8, verbose_name='state')),
                ('notice', models.OneToOneField(on_delete=django.db.models.deletion.CASCADE, related_name='mail', to='league.notice', verbose_name='notice')),
            ],
            options={
                'verbose_name': 'mail',
                'verbose_name_plural': 'mails',
            },
        ),
        migrations.CreateModel(
            name='RecordedRace',
            fields=[
                ('id', models.BigAutoField(auto_created=True, primary_key=True, serialize=False, verbose_name='ID')),
                ('position', models.PositiveIntegerField(verbose_name='row in races.csv')),
                ('row', models.JSONField(verbose_name='row')),
                ('heading', models.JSONField(verbose_name='columns of the results')),
                ('decimals', models.JSONField(blank=True, default=list, verbose_name='columns written with a decimal point')),
                ('race', models.OneToOneField(on_delete=django.db.models.deletion.CASCADE, related_name='record', to='races.race', verbose_name='race')),
            ],
            options={
                'verbose_name': 'imported race',
                'verbose_name_plural': 'imported races',
            },
        ),
        migrations.CreateModel(
            name='RecordedResult',
            fields=[
                ('entry', models.OneToOneField(on_delete=django.db.models.deletion.CASCADE, primary_key=True, related_name='record', serialize=False, to='races.entry', verbose_name='entry')),
                ('alias', models.CharField(max_length=64, verbose_name='alias')),
                ('rank', models.PositiveIntegerField(verbose_name='rank')),
                ('score', models.BigIntegerField(verbose_name='score')),
                ('measured', models.BooleanField(default=True, verbose_name='score is the time ranked by')),
                ('collisions', models.PositiveIntegerField(default=0, verbose_name='collisions')),
                ('average_resets', models.FloatField(default=0.0, verbose_name='resets a lap')),
                ('status', models.CharField(max_length=32, verbose_name='status')),
                ('division', models.CharField(blank=True, max_length=32, verbose_name='division')),
                ('blank', models.JSONField(blank=True, default=list, verbose_name='columns left empty')),
            ],
            options={
                'verbose_name': 'imported result',
                'verbose_name_plural': 'imported results',
                'constraints': [models.CheckConstraint(condition=models.Q(('rank__gte', 1)), name='recorded_rank_from_one'), models.CheckConstraint(condition=models.Q(('score__gte', 0)), name='recorded_score_not_negative')],
            },
        ),
        migrations.CreateModel(
            name='Round',
            fields=[
                ('id', models.BigAutoField(auto_created=True, primary_key=True, serialize=False, verbose_name='ID')),
                ('number', models.PositiveSmallIntegerField(verbose_name='number')),
                ('stage', models.CharField(blank=True, choices=[('open-qualifier', 'open race'), ('pro-qualifier', 'pro race'), ('pro-finale', 'finale'), ('championship', 'championship'), ('single', 'race of its own')], help_text='Empty: the open or the pro race of the month, whichever division the race has.', max_length=16, verbose_name='stage')),
                ('name', models.CharField(blank=True, help_text='The races of a month have the same one; a finale belongs to the qualifier of the same name.', max_length=64, validators=[django.core.validators.RegexValidator('^[^\\x00-\\x1f\\x7f]*\\S[^\\x00-\\x1f\\x7f]*\\Z', 'Write a name on one line.', code='one_line')], verbose_name='name of the month')),
                ('closed_at', models.DateTimeField(blank=True, editable=False, null=True, verbose_name='official since')),
                ('held_at', models.DateTimeField(blank=True, editable=False, help_text='A steward took the results back: they become official again when an admin says so.', null=True, verbose_name='held back since')),
                ('locked_at', models.DateTimeField(blank=True, editable=False, help_text='Final from then on, whatever the window says.', null=True, verbose_name='locked')),
                ('race', models.OneToOneField(on_delete=django.db.models.deletion.PROTECT, related_name='round', to='races.race', verbose_name='race')),
            ],
            options={
                'verbose_name': 'round',
                'verbose_name_plural': 'rounds',
                'ordering': ['season', 'number'],
            },
        ),
        migrations.CreateModel(
            name='FinalePlace',
            fields=[
                ('id', models.BigAutoField(auto_created=True, primary_key=True, serialize=False, verbose_name='ID')),
                ('place', models.PositiveSmallIntegerField(verbose_name='place')),
                ('racer', models.ForeignKey(on_delete=django.db.models.deletion.CASCADE, related_name='finale_places', to=settings.AUTH_USER_MODEL, verbose_name='racer')),
                ('round', models.ForeignKey(on_delete=django.db.models.deletion.CASCADE, related_name='finale_places', to='league.round', verbose_name='pro race')),
            ],
            options={
                'verbose_name': 'place in a finale',
                'verbose_name_plural': 'places in finales',
                'ordering': ['round', 'place'],
            },
        ),
        migrations.CreateModel(
            name='RoundPoints',
            fields=[
                ('id', models.BigAutoField(auto_created=True, primary_key=True, serialize=False, verbose_name='ID')),
                ('rank', models.PositiveSmallIntegerField(verbose_name='rank')),
                ('points', models.PositiveSmallIntegerField(verbose_name='points')),
                ('country', models.CharField(blank=True, max_length=2, verbose_name='country')),
                ('team', models.CharField(blank=True, max_length=64, verbose_name='team')),
                ('racer', models.ForeignKey(on_delete=django.db.models.deletion.CASCADE, related_name='round_points', to=settings.AUTH_USER_MODEL, verbose_name='racer')),
                ('round', models.ForeignKey(on_delete=django.db.models.deletion.CASCADE, related_name='points', to='league.round', verbose_name='round')),
            ],
            options={
                'verbose_name': 'points of a round',
                'verbose_name_plural': 'points of rounds',
                'ordering': ['round', 'rank'],
            },
        ),
        migrations.CreateModel(
            name='Season',
            fields=[
                ('id', models.BigAutoField(auto_created=True, primary_key=True, serialize=False, verbose_name='ID')),
                ('slug', models.SlugField(unique=True, verbose_name='address')),
                ('name', models.CharField(max_length=64, verbose_name='name')),
                ('starts_on', models.DateField(verbose_name='starts')),
                ('ends_on', models.DateField(verbose_name='ends')),
                ('promotion_percent', models.DecimalField(decimal_places=1, default=Decimal('10'), help_text="Of the classified racers of a month's open race; at least one is promoted.", max_digits=4, verbose_name='promoted, per cent')),
                ('finale_size', models.PositiveSmallIntegerField(default=16, validators=[django.core.validators.MinValueValidator(1), django.core.validators.MaxValueValidator(1000)], verbose_name='cars in a finale')),
                ('championship_places', models.PositiveSmallIntegerField(default=3, validators=[django.core.validators.MinValueValidator(1), django.core.validators.MaxValueValidator(1000)], verbose_name='places in the championship from each finale')),
                ('points', models.JSONField(default=league.models.season.default_points, help_text="A list that never rises, the winner's points first.", verbose_name='points by place')),
                ('drop_worst', models.PositiveSmallIntegerField(default=0, help_text='A round that a racer missed is a result of no points.', verbose_name='worst results dropped')),
                ('steward_hours', models.PositiveSmallIntegerField(default=48, help_text='For so long after a round has closed its results can be corrected.', validators=[django.core.validators.MaxValueValidator(1440)], verbose_name='steward window in hours')),
                ('prizes', models.TextField(blank=True, max_length=4000, verbose_name='prizes')),
            ],
            options={
                'verbose_name': 'season',
                'verbose_name_plural': 'seasons',
                'ordering': ['-starts_on'],
                'constraints': [models.CheckConstraint(condition=models.Q(('ends_on__gt', models.F('starts_on'))), name='season_ends_after_start', violation_error_message='The season ends before it starts. Choose a later last day.'), models.CheckConstraint(condition=models.Q(('promotion_percent__gt', 0), ('promotion_percent__lt', 100)), name='season_promotes_some_not_all'), models.CheckConstraint(condition=models.Q(('championship_places__gte', 1), ('championship_places__lte', models.F('finale_size'))), name='season_finale_holds_its_championship_places')],
            },
        ),
        migrations.AddField(
            model_name='round',
            name='season',
            field=models.ForeignKey(on_delete=django.db.models.deletion.CASCADE, related_name='rounds', to='league.season', verbose_name='season'),
        ),
        migrations.CreateModel(
            name='RecordedSeason',
            fields=[
                ('id', models.BigAutoField(auto_created=True, primary_key=True, serialize=False, verbose_name='ID')),
                ('label', models.CharField(max_length=50, unique=True, verbose_name='season in the record')),
                ('digest', models.CharField(max_length=64, verbose_name='digest')),
                ('imported_at', models.DateTimeField(verbose_name='imported')),
                ('season', models.OneToOneField(on_delete=django.db.models.deletion.CASCADE, related_name='record', to='league.season', verbose_name='season')),
            ],
            options={
                'verbose_name': 'imported season',
                'verbose_name_plural': 'imported seasons',
            },
        ),
        migrations.CreateModel(
            name='Membership',
            fields=[
                ('id', models.BigAutoField(auto_created=True, primary_key=True, serialize=False, verbose_name='ID')),
                ('division', models.CharField(choices=[('open', 'open division'), ('pro', 'pro division')], default='pro', max_length=4, verbose_name='division')),
                ('since', models.DateTimeField(default=django.utils.timezone.now, verbose_name='since')),
                ('place', models.PositiveIntegerField(blank=True, editable=False, null=True, verbose_name='place there')),
                ('racer', models.ForeignKey(on_delete=django.db.models.deletion.CASCADE, related_name='memberships', to=settings.AUTH_USER_MODEL, verbose_name='racer')),
                ('promoted_in', models.ForeignKey(blank=True, editable=False, null=True, on_delete=django.db.models.deletion.CASCADE, related_name='promotions', to='league.round', verbose_name='promoted in')),
                ('season', models.ForeignKey(on_delete=django.db.models.deletion.CASCADE, related_name='memberships', to='league.season', verbose_name='season')),
            ],
            options={
                'verbose_name': 'division of a racer',
                'verbose_name_plural': 'divisions of racers',
                'ordering': ['season', 'division', 'racer'],
            },
        ),
        migrations.CreateModel(
            name='DuelRating',
            fields=[
                ('id', models.BigAutoField(auto_created=True, primary_key=True, serialize=False, verbose_name='ID')),
                ('mu', models.FloatField(verbose_name='skill')),
                ('sigma', models.FloatField(verbose_name='uncertainty')),
                ('duels', models.PositiveIntegerField(verbose_name='duels')),
                ('racer', models.ForeignKey(on_delete=django.db.models.deletion.CASCADE, related_name='duel_ratings', to=settings.AUTH_USER_MODEL, verbose_name='racer')),
                ('season', models.ForeignKey(db_index=False, on_delete=django.db.models.deletion.CASCADE, related_name='duel_ratings', to='league.season', verbose_name='season')),
            ],
            options={
                'verbose_name': 'rating',
                'verbose_name_plural': 'ratings',
                'ordering': ['season', 'pk'],
            },
        ),
        migrations.CreateModel(
            name='ChampionshipPlace',
            fields=[
                ('id', models.BigAutoField(auto_created=True, primary_key=True, serialize=False, verbose_name='ID')),
                ('place', models.PositiveSmallIntegerField(verbose_name='place')),
                ('racer', models.ForeignKey(on_delete=django.db.models.deletion.CASCADE, related_name='championship_places', to=settings.AUTH_USER_MODEL, verbose_name='racer')),
                ('round', models.ForeignKey(on_delete=django.db.models.deletion.CASCADE, related_name='championship_places', to='league.round', verbose_name='finale')),
                ('season', models.ForeignKey(on_delete=django.db.models.deletion.CASCADE, related_name='places_held', to='league.season', verbose_name='season')),
            ],
            options={
                'verbose_name': 'place in a championship',
                'verbose_name_plural': 'places in championships',
                'ordering': ['season', 'round', 'place'],
            },
        ),
        migrations.CreateModel(
            name='StageRules',
            fields=[
                ('id', models.BigAutoField(auto_created=True, primary_key=True, serialize=False, verbose_name='ID')),
                ('rules', models.JSONField(blank=True, db_default={}, default=races.models.rules.inside_a_stage, editable=False, verbose_name='other rules')),
                ('ranking_method', models.CharField(choices=[('average', 'average lap'), ('best', 'best lap'), ('total', 'total time')], default='average', max_length=7, verbose_name='Ranked by')),
                ('laps', models.PositiveSmallIntegerField(default=3, validators=[django.core.validators.MinValueValidator(1), django.core.validators.MaxValueValidator(20)], verbose_name='Laps driven')),
                ('minimum_laps', models.PositiveSmallIntegerField(default=3, help_text='The average is taken over this many consecutive complete laps.', validators=[django.core.validators.MinValueValidator(1), django.core.validators.MaxValueValidator(20)], verbose_name='Laps in a row to be classified')),
                ('off_track_penalty_ms', models.PositiveIntegerField(default=2000, help_text='The car stands still for so long before it goes on.', validators=[django.core.validators.MaxValueValidator(60000)], verbose_name='Off-track penalty in milliseconds')),
                ('collision_penalty_ms', models.PositiveIntegerField(default=5000, help_text='For running into a box, a bot or another car.', validators=[django.core.validators.MaxValueValidator(60000)], verbose_name='Collision penalty in milliseconds')),
                ('max_resets', models.PositiveIntegerField(default=10000, help_text='0: the first fault ends the run.', validators=[django.core.validators.MaxValueValidator(10000)], verbose_name='Resets allowed')),
                ('max_simulated_ms', models.PositiveIntegerField(default=180000, help_text='Simulated time for the whole run.', validators=[django.core.validators.MinValueValidator(10000), django.core.validators.MaxValueValidator(1200000)], verbose_name='Time limit in milliseconds')),
                ('max_submissions', models.PositiveSmallIntegerField(default=50, validators=[django.core.validators.MinValueValidator(1), django.core.validators.MaxValueValidator(1000)], verbose_name='Submissions for each racer')),
                ('stage', models.CharField(choices=[('open-qualifier', 'open race'), ('pro-qualifier', 'pro race'), ('pro-finale', 'finale'), ('championship', 'championship'), ('single', 'race of its own')], max_length=16, verbose_name='stage')),
                ('season', models.ForeignKey(on_delete=django.db.models.deletion.CASCADE, related_name='stage_rules', to='league.season', verbose_name='season')),
            ],
            options={
                'verbose_name': 'rules of a stage',
                'verbose_name_plural': 'rules of stages',
                'ordering': ['season', 'stage'],
            },
        ),
        migrations.CreateModel(
            name='StewardDecision',
            fields=[
                ('id', models.BigAutoField(auto_created=True, primary_key=True, serialize=False, verbose_name='ID')),
                ('decision', models.CharField(choices=[('disqualified', 'disqualified'), ('restored', 'put back'), ('reopened', 'results taken back'), ('locked', 'results locked')], max_length=12, verbose_name='decision')),
                ('reason', models.CharField(max_length=255, verbose_name='reason')),
                ('at', models.DateTimeField(verbose_name='at')),
                ('by', models.ForeignKey(blank=True, null=True, on_delete=django.db.models.deletion.SET_NULL, related_name='+', to=settings.AUTH_USER_MODEL, verbose_name='decided by')),
                ('racer', models.ForeignKey(blank=True, null=True, on_delete=django.db.models.deletion.CASCADE, related_name='+', to=settings.AUTH_USER_MODEL, verbose_name='racer concerned')),
                ('round', models.ForeignKey(on_delete=django.db.models.deletion.CASCADE, related_name='decisions', to='league.round', verbose_name='round')),
            ],
            options={
                'verbose_name': "steward's decision",
                'verbose_name_plural': "stewards' decisions",
                'ordering': ['-at', '-pk'],
            },
        ),
        migrations.CreateModel(
            name='Webhook',
            fields=[
                ('id', models.BigAutoField(auto_created=True, primary_key=True, serialize=False, verbose_name='ID')),
                ('url', models.URLField(max_length=500, verbose_name='address')),
                ('host', models.CharField(blank=True, db_default='', default='', editable=False, max_length=255, verbose_name='host')),
                ('events', models.JSONField(blank=True, default=list, verbose_name='events')),
                ('secret', models.CharField(default=league.models.webhook.new_secret, editable=False, max_length=40, verbose_name='secret')),
                ('old_secret', models.CharField(blank=True, editable=False, max_length=40, verbose_name='secret before')),
                ('old_secret_until', models.DateTimeField(blank=True, editable=False, null=True, verbose_name='signs until')),
                ('created_at', models.DateTimeField(default=django.utils.timezone.now, editable=False, verbose_name='made')),
                ('owner', models.ForeignKey(on_delete=django.db.models.deletion.CASCADE, related_name='webhooks', to=settings.AUTH_USER_MODEL, verbose_name='owner')),
                ('race', models.ForeignKey(blank=True, null=True, on_delete=django.db.models.deletion.CASCADE, related_name='webhooks', to='races.race', verbose_name='race')),
            ],
            options={
                'verbose_name': 'webhook',
                'verbose_name_plural': 'webhooks',
                'ordering': ['pk'],
            },
        ),
        migrations.CreateModel(
            name='WebhookDelivery',
            fields=[
                ('id', models.BigAutoField(auto_created=True, primary_key=True, serialize=False, verbose_name='ID')),
                ('attempt', models.PositiveSmallIntegerField(db_default=0, default=0, verbose_name='attempt')),
                ('lease', models.UUIDField(blank=True, editable=False, null=True, verbose_name='lease')),
                ('leased_until', models.DateTimeField(blank=True, null=True, verbose_name='leased until')),
                ('worker', models.CharField(blank=True, db_default='', default='', max_length=128, verbose_name='worker')),
                ('not_before', models.DateTimeField(blank=True, null=True, verbose_name='pauses until')),
                ('started_at', models.DateTimeField(blank=True, null=True, verbose_name='started')),
                ('ended_at', models.DateTimeField(blank=True, null=True, verbose_name='ended')),
                ('event', models.CharField(max_length=20, verbose_name='event')),
                ('about', models.CharField(max_length=160, verbose_name='about')),
                ('body', models.TextField(verbose_name='body')),
                ('at', models.DateTimeField(verbose_name='at')),
                ('state', models.CharField(default='due', max_length=8, verbose_name='state')),
                ('status', models.PositiveSmallIntegerField(blank=True, null=True, verbose_name='answer')),
                ('error', models.CharField(blank=True, max_length=200, verbose_name='what went wrong')),
                ('webhook', models.ForeignKey(db_index=False, on_delete=django.db.models.deletion.CASCADE, related_name='deliveries', to='league.webhook')),
            ],
            options={
                'verbose_name': 'delivery',
                'verbose_name_plural': 'deliveries',
                'ordering': ['-at', '-pk'],
            },
        ),
        migrations.AddIndex(
            model_name='notice',
            index=models.Index(fields=['racer', '-at'], name='notice_by_racer'),
        ),
        migrations.AddIndex(
            model_name='notice',
            index=models.Index(fields=['at'], name='notice_by_time'),
        ),
        migrations.AddConstraint(
            model_name='notice',
            constraint=models.UniqueConstraint(fields=('racer', 'kind', 'about'), name='notice_once'),
        ),
        migrations.AddConstraint(
            model_name='notice',
            constraint=models.CheckConstraint(condition=models.Q(('kind__in', ['opens', 'closes', 'result', 'lost_lead', 'promoted', 'finale', 'qualified', 'official', 'message', 'cancelled', 'disqualified', 'restored', 'retimed'])), name='notice_kind_known'),
        ),
        migrations.AddIndex(
            model_name='mail',
            index=models.Index(condition=models.Q(('state', 'due')), fields=['id'], name='mail_due'),
        ),
        migrations.AddIndex(
            model_name='mail',
            index=models.Index(condition=models.Q(('state', 'sending')), fields=['leased_until'], name='mail_leases'),
        ),
        migrations.AddConstraint(
            model_name='mail',
            constraint=models.CheckConstraint(condition=models.Q(('state__in', ['due', 'sending', 'sent', 'failed'])), name='mail_state_known'),
        ),
        migrations.AddConstraint(
            model_name='mail',
            constraint=models.CheckConstraint(condition=models.Q(models.Q(('lease__isnull', False), ('leased_until__isnull', False), ('started_at__isnull', False), ('state', 'sending')), models.Q(models.Q(('state', 'sending'), _negated=True), ('lease__isnull', True), ('leased_until__isnull', True)), _connector='OR'), name='mail_lease_while_sending'),
        ),
        migrations.AddConstraint(
            model_name='mail',
            constraint=models.CheckConstraint(condition=models.Q(models.Q(('ended_at__isnull', False), ('state__in', ['sent', 'failed'])), models.Q(('ended_at__isnull', True), ('state__in', ['due', 'sending'])), _connector='OR'), name='mail_ended_when_final'),
        ),
        migrations.AddConstraint(
            model_name='mail',
            constraint=models.CheckConstraint(condition=models.Q(('not_before__isnull', True), ('state', 'due'), _connector='OR'), name='mail_pauses_while_due'),
        ),
        migrations.AddConstraint(
            model_name='finaleplace',
            constraint=models.UniqueConstraint(fields=('round', 'racer'), name='finale_place_once_a_racer'),
        ),
        migrations.AddConstraint(
            model_name='finaleplace',
            constraint=models.UniqueConstraint(fields=('round', 'place'), name='finale_place_once'),
        ),
        migrations.AddConstraint(
            model_name='finaleplace',
            constraint=models.CheckConstraint(condition=models.Q(('place__gte', 1)), name='finale_place_from_one'),
        ),
        migrations.AddConstraint(
            model_name='roundpoints',
            constraint=models.UniqueConstraint(fields=('round', 'racer'), name='round_points_once_a_racer'),
        ),
        migrations.AddConstraint(
            model_name='roundpoints',
            constraint=models.UniqueConstraint(fields=('round', 'rank'), name='round_points_once_a_rank'),
        ),
        migrations.AddConstraint(
            model_name='roundpoints',
            constraint=models.CheckConstraint(condition=models.Q(('rank__gte', 1)), name='round_points_rank_from_one'),
        ),
        migrations.AddIndex(
            model_name='round',
            index=models.Index(condition=models.Q(('closed_at__isnull', False)), fields=['closed_at'], name='round_by_closing'),
        ),
        migrations.AddConstraint(
            model_name='round',
            constraint=models.CheckConstraint(condition=models.Q(('number__gte', 1)), name='round_number_from_one'),
        ),
        migrations.AddConstraint(
            model_name='round',
            constraint=models.CheckConstraint(condition=models.Q(('closed_at', None), ('held_at', None), _connector='OR'), name='round_official_or_held_back'),
        ),
        migrations.AddConstraint(
            model_name='round',
            constraint=models.CheckConstraint(condition=models.Q(('locked_at', None), ('closed_at__isnull', False), _connector='OR'), name='round_locked_when_official'),
        ),
        migrations.AddConstraint(
            model_name='round',
            constraint=models.CheckConstraint(condition=models.Q(('stage__in', ['open-qualifier', 'pro-qualifier', 'pro-finale', 'championship', 'single'])), name='round_stage_known'),
        ),
        migrations.AddConstraint(
            model_name='round',
            constraint=models.UniqueConstraint(fields=('season', 'number', 'stage'), name='round_one_race_of_a_stage', violation_error_message='This division already has a race in this round of the season.'),
        ),
        migrations.AddConstraint(
            model_name='membership',
            constraint=models.UniqueConstraint(fields=('season', 'racer'), name='membership_one_division_a_season'),
        ),
        migrations.AddConstraint(
            model_name='membership',
            constraint=models.CheckConstraint(condition=models.Q(('division__in', ['open', 'pro'])), name='membership_division_known'),
        ),
        migrations.AddConstraint(
            model_name='membership',
            constraint=models.CheckConstraint(condition=models.Q(models.Q(('place', None), ('promoted_in', None)), models.Q(('division', 'pro'), ('place__isnull', False), ('promoted_in__isnull', False)), _connector='OR'), name='membership_promoted_to_pro'),
        ),
        migrations.AddConstraint(
            model_name='duelrating',
            constraint=models.UniqueConstraint(fields=('season', 'racer'), name='rating_once_a_season'),
        ),
        migrations.AddConstraint(
            model_name='duelrating',
            constraint=models.CheckConstraint(condition=models.Q(('duels__gte', 1), ('sigma__gt', 0)), name='rating_after_a_duel'),
        ),
        migrations.AddConstraint(
            model_name='championshipplace',
            constraint=models.UniqueConstraint(fields=('season', 'racer'), name='championship_place_once_a_racer'),
        ),
        migrations.AddConstraint(
            model_name='championshipplace',
            constraint=models.UniqueConstraint(fields=('round', 'place'), name='championship_place_once'),
        ),
        migrations.AddConstraint(
            model_name='championshipplace',
            constraint=models.CheckConstraint(condition=models.Q(('place__gte', 1)), name='championship_place_from_one'),
        ),
        migrations.AddConstraint(
            model_name='stagerules',
            constraint=models.UniqueConstraint(fields=('season', 'stage'), name='stage_rules_once_a_season'),
        ),
        migrations.AddConstraint(
            model_name='stagerules',
            constraint=models.CheckConstraint(condition=models.Q(('stage__in', ['open-qualifier', 'pro-qualifier', 'pro-finale', 'championship', 'single'])), name='stage_rules_stage_known'),
        ),
        migrations.AddConstraint(
            model_name='stagerules',
            constraint=models.CheckConstraint(condition=models.Q(('minimum_laps__gte', 1), ('minimum_laps__lte', models.F('laps'))), name='stage_rules_minimum_laps_within_laps'),
        ),
        migrations.AddConstraint(
            model_name='stagerules',
            constraint=models.CheckConstraint(condition=models.Q(('laps__gte', 1), ('laps__lte', 20)), name='stage_rules_laps_range'),
        ),
        migrations.AddConstraint(
            model_name='stagerules',
            constraint=models.CheckConstraint(condition=models.Q(models.Q(('ranking_method', 'total'), _negated=True), ('minimum_laps', models.F('laps')), _connector='OR'), name='stage_rules_total_needs_all_laps'),
        ),
        migrations.AddIndex(
            model_name='stewarddecision',
            index=models.Index(fields=['at'], name='decision_by_time'),
        ),
        migrations.AddConstraint(
            model_name='stewarddecision',
            constraint=models.CheckConstraint(condition=models.Q(('reason', ''), _negated=True), name='decision_has_a_reason'),
        ),
        migrations.AddConstraint(
            model_name='stewarddecision',
            constraint=models.CheckConstraint(condition=models.Q(('decision__in', ['disqualified', 'restored', 'reopened', 'locked'])), name='decision_known'),
        ),
        migrations.AddConstraint(
            model_name='stewarddecision',
            constraint=models.CheckConstraint(condition=models.Q(models.Q(('decision__in', ['reopened', 'locked']), ('racer', None)), models.Q(models.Q(('decision__in', ['reopened', 'locked']), _negated=True), ('racer__isnull', False)), _connector='OR'), name='decision_names_its_racer'),
        ),
        migrations.AddConstraint(
            model_name='webhook',
            constraint=models.CheckConstraint(condition=models.Q(models.Q(('old_secret', ''), ('old_secret_until', None)), models.Q(models.Q(('old_secret', ''), _negated=True), models.Q(('old_secret_until', None), _negated=True)), _connector='OR'), name='webhook_old_secret_ends'),
        ),
        migrations.AddIndex(
            model_name='webhookdelivery',
            index=models.Index(condition=models.Q(('state', 'due')), fields=['not_before'], name='delivery_due'),
        ),
        migrations.AddIndex(
            model_name='webhookdelivery',
            index=models.Index(fields=['at'], name='delivery_by_time'),
        ),
        migrations.AddIndex(
            model_name='webhookdelivery',
            index=models.Index(condition=models.Q(('state', 'sending')), fields=['leased_until'], name='delivery_leases'),
        ),
        migrations.AddConstraint(
            model_name='webhookdelivery',
            constraint=models.UniqueConstraint(fields=('webhook', 'event', 'about'), name='delivery_once'),
        ),
        migrations.AddConstraint(
            model_name='webhookdelivery',
            constraint=models.CheckConstraint(condition=models.Q(('state__in', ['due', 'sending', 'sent', 'failed'])), name='delivery_state_known'),
        ),
        migrations.AddConstraint(
            model_name='webhookdelivery',
            constraint=models.CheckConstraint(condition=models.Q(models.Q(('lease__isnull', False), ('leased_until__isnull', False), ('started_at__isnull', False), ('state', 'sending')), models.Q(models.Q(('state', 'sending'), _negated=True), ('lease__isnull', True), ('leased_until__isnull', True)), _connector='OR'), name='delivery_lease_while_sending'),
        ),
        migrations.AddConstraint(
            model_name='webhookdelivery',
            constraint=models.CheckConstraint(condition=models.Q(models.Q(('ended_at__isnull', False), ('state__in', ['sent', 'failed'])), models.Q(('ended_at__isnull', True), ('state__in', ['due', 'sending'])), _connector='OR'), name='delivery_ended_when_final'),
        ),
        migrations.AddConstraint(
            model_name='webhookdelivery',
            constraint=models.CheckConstraint(condition=models.Q(('not_before__isnull', True), ('state', 'due'), _connector='OR'), name='delivery_pauses_while_due'),
        ),
    ]
