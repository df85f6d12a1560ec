import django.db.models.deletion
from django.conf import settings
from django.db import migrations, models


class Migration(migrations.Migration):

    initial = True

    dependencies = [
        ('accounts', '0001_initial'),
        ('knox', '0009_extend_authtoken_field'),
    ]

    operations = [
        migrations.CreateModel(
            name='TokenGrant',
            fields=[
                ('token', models.OneToOneField(on_delete=django.db.models.deletion.CASCADE, primary_key=True, related_name='grant', serialize=False, to=settings.KNOX_TOKEN_MODEL, verbose_name='token')),
                ('may_read', models.BooleanField(verbose_name='may read')),
                ('may_race', models.BooleanField(verbose_name='may race')),
                ('may_train', models.BooleanField(verbose_name='may train')),
                ('may_organise', models.BooleanField(verbose_name='may organise')),
                ('last_used_at', models.DateTimeField(editable=False, null=True, verbose_name='last used')),
            ],
            options={
                'verbose_name': 'grant of a token',
                'verbose_name_plural': 'grants of tokens',
                'constraints': [models.CheckConstraint(condition=models.Q(('may_read', True), ('may_race', True), ('may_train', True), ('may_organise', True), _connector='OR'), name='token_grant_of_something')],
            },
        ),
    ]
