import accounts.models.access
import accounts.quotas
import django.core.validators
import django.db.models.deletion
import django.db.models.functions.text
import django.utils.timezone
from django.conf import settings
from django.db import migrations, models


class Migration(migrations.Migration):

    initial = True

    dependencies = [
        ('auth', '0012_alter_user_first_name_max_length'),
    ]

    operations = [
        migrations.CreateModel(
            name='Racer',
            fields=[
                ('id', models.BigAutoField(auto_created=True, primary_key=True, serialize=False, verbose_name='ID')),
                ('password', models.CharField(max_length=128, verbose_name='password')),
                ('last_login', models.DateTimeField(blank=True, null=True, verbose_name='last login')),
                ('is_superuser', models.BooleanField(default=False, help_text='Designates that this user has all permissions without explicitly assigning them.', verbose_name='superuser status')),
                ('alias', models.CharField(max_length=64, unique=True, validators=[django.core.validators.RegexValidator('^[A-Za-z0-9_-]{2,64}$', 'Use 2 to 64 letters, digits, hyphens and underscores.', code='alias')], verbose_name='alias')),
                ('email', models.EmailField(max_length=254, unique=True, verbose_name='e-mail address')),
                ('country', models.CharField(blank=True, help_text='Two-letter code, such as KR.', max_length=2, verbose_name='country')),
                ('team', models.CharField(blank=True, max_length=64, validators=[django.core.validators.RegexValidator('^[^\\x00-\\x1f\\x7f]*\\S[^\\x00-\\x1f\\x7f]*\\Z', 'Write a name on one line.', code='one_line')], verbose_name='team')),
                ('record_id', models.CharField(editable=False, max_length=64, null=True, unique=True, verbose_name='id in imported seasons')),
                ('is_house', models.BooleanField(default=False, verbose_name='house car')),
                ('is_staff', models.BooleanField(default=False, verbose_name='admin')),
                ('is_active', models.BooleanField(default=True, verbose_name='active')),
                ('joined_at', models.DateTimeField(default=django.utils.timezone.now, verbose_name='joined')),
                ('groups', models.ManyToManyField(blank=True, help_text='The groups this user belongs to. A user will get all permissions granted to each of their groups.', related_name='user_set', related_query_name='user', to='auth.group', verbose_name='groups')),
                ('user_permissions', models.ManyToManyField(blank=True, help_text='Specific permissions for this user.', related_name='user_set', related_query_name='user', to='auth.permission', verbose_name='user permissions')),
            ],
            options={
                'verbose_name': 'racer',
                'verbose_name_plural': 'racers',
            },
        ),
        migrations.CreateModel(
            name='KnownAddress',
            fields=[
                ('id', models.BigAutoField(auto_created=True, primary_key=True, serialize=False, verbose_name='ID')),
                ('digest', models.CharField(max_length=64)),
                ('seen_at', models.DateTimeField()),
                ('racer', models.ForeignKey(on_delete=django.db.models.deletion.CASCADE, related_name='known_addresses', to=settings.AUTH_USER_MODEL)),
            ],
            options={
                'verbose_name': 'known address',
                'verbose_name_plural': 'known addresses',
            },
        ),
        migrations.CreateModel(
            name='RacerQuota',
            fields=[
                ('id', models.BigAutoField(auto_created=True, primary_key=True, serialize=False, verbose_name='ID')),
                ('name', models.CharField(choices=accounts.quotas.name_choices, max_length=40, verbose_name='quota')),
                ('limit', models.PositiveIntegerField(help_text="In place of the site's. 0 means none at all.", validators=[django.core.validators.MinValueValidator(0)], verbose_name='limit')),
                ('racer', models.ForeignKey(on_delete=django.db.models.deletion.CASCADE, related_name='quotas', to=settings.AUTH_USER_MODEL, verbose_name='racer')),
            ],
            options={
                'verbose_name': 'quota of a racer',
                'verbose_name_plural': 'quotas of racers',
            },
        ),
        migrations.CreateModel(
            name='SignUpInvitation',
            fields=[
                ('id', models.BigAutoField(auto_created=True, primary_key=True, serialize=False, verbose_name='ID')),
                ('code', models.CharField(default=accounts.models.access.new_code, editable=False, max_length=32, unique=True, verbose_name='code')),
                ('note', models.CharField(blank=True, help_text='For admins: who it is for.', max_length=100, verbose_name='note')),
                ('uses', models.PositiveIntegerField(default=1, help_text='How many may sign up with it.', verbose_name='racers')),
                ('used', models.PositiveIntegerField(default=0, editable=False, verbose_name='signed up')),
                ('expires_at', models.DateTimeField(verbose_name='expires')),
                ('made_at', models.DateTimeField(editable=False, verbose_name='made')),
                ('made_by', models.ForeignKey(editable=False, null=True, on_delete=django.db.models.deletion.SET_NULL, related_name='+', to=settings.AUTH_USER_MODEL, verbose_name='made by')),
            ],
            options={
                'verbose_name': 'invitation to sign up',
                'verbose_name_plural': 'invitations to sign up',
                'ordering': ['-made_at', '-pk'],
            },
        ),
        migrations.AddConstraint(
            model_name='racer',
            constraint=models.UniqueConstraint(django.db.models.functions.text.Lower('alias'), name='racer_alias_unique_in_any_case'),
        ),
        migrations.AddConstraint(
            model_name='racer',
            constraint=models.CheckConstraint(condition=models.Q(('alias__regex', '^[A-Za-z0-9_-]{2,64}$')), name='racer_alias_form'),
        ),
        migrations.AddConstraint(
            model_name='racer',
            constraint=models.CheckConstraint(condition=models.Q(('country__regex', '^([A-Z]{2})?$')), name='racer_country_form'),
        ),
        migrations.AddConstraint(
            model_name='racer',
            constraint=models.CheckConstraint(condition=models.Q(('is_house', False), ('is_staff', False), _connector='OR'), name='racer_house_is_no_admin'),
        ),
        migrations.AddConstraint(
            model_name='racer',
            constraint=models.CheckConstraint(condition=models.Q(('record_id', None), models.Q(('is_active', False), ('is_house', False), ('is_staff', False), models.Q(('record_id', ''), _negated=True)), _connector='OR'), name='racer_of_a_record_has_no_log_in'),
        ),
        migrations.AddConstraint(
            model_name='knownaddress',
            constraint=models.UniqueConstraint(fields=('racer', 'digest'), name='known_address_once'),
        ),
        migrations.AddConstraint(
            model_name='racerquota',
            constraint=models.UniqueConstraint(fields=('racer', 'name'), name='racer_quota_once'),
        ),
        migrations.AddConstraint(
            model_name='racerquota',
            constraint=models.CheckConstraint(condition=models.Q(('limit__gte', 0), ('limit__lte', 2000000000)), name='racer_quota_in_bounds'),
        ),
        migrations.AddConstraint(
            model_name='signupinvitation',
            constraint=models.CheckConstraint(condition=models.Q(('uses__gte', 1), ('uses__lte', 10000)), name='invitation_uses_in_bounds'),
        ),
        migrations.AddConstraint(
            model_name='signupinvitation',
            constraint=models.CheckConstraint(condition=models.Q(('used__lte', models.F('uses'))), name='invitation_used_within_its_uses'),
        ),
    ]
