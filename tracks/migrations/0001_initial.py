import django.db.models.deletion
import django.utils.timezone
from django.conf import settings
from django.db import migrations, models


class Migration(migrations.Migration):

    initial = True

    dependencies = [
        migrations.swappable_dependency(settings.AUTH_USER_MODEL),
    ]

    operations = [
        migrations.CreateModel(
            name='Track',
            fields=[
                ('id', models.BigAutoField(auto_created=True, primary_key=True, serialize=False, verbose_name='ID')),
                ('slug', models.SlugField(max_length=64, unique=True, verbose_name='address')),
                ('name', models.CharField(max_length=64, verbose_name='name')),
                ('description', models.TextField(blank=True, max_length=1000, verbose_name='description')),
                ('npy', models.BinaryField(verbose_name='geometry')),
                ('fingerprint', models.CharField(editable=False, max_length=64, unique=True, verbose_name='fingerprint')),
                ('length_m', models.FloatField(blank=True, editable=False, null=True, verbose_name='length in metres')),
                ('width_m', models.FloatField(blank=True, editable=False, null=True, verbose_name='width in metres')),
                ('corners', models.PositiveSmallIntegerField(blank=True, editable=False, null=True, verbose_name='corners')),
                ('difficulty', models.PositiveSmallIntegerField(blank=True, editable=False, null=True, verbose_name='difficulty')),
                ('direction', models.CharField(choices=[('ccw', 'counter-clockwise'), ('cw', 'clockwise')], editable=False, max_length=3, verbose_name="the file's own direction")),
                ('look', models.CharField(choices=[('official', 'as in the official simulator'), ('textures', 'the official textures in full light'), ('bold', 'large dashes, a far and high wall')], default='official', editable=False, max_length=16, verbose_name='look')),
                ('is_catalogue', models.BooleanField(default=False, editable=False, verbose_name='from the catalogue')),
                ('created_at', models.DateTimeField(default=django.utils.timezone.now, editable=False, verbose_name='added')),
                ('owner', models.ForeignKey(blank=True, null=True, on_delete=django.db.models.deletion.SET_NULL, related_name='tracks', to=settings.AUTH_USER_MODEL, verbose_name='imported by')),
            ],
            options={
                'verbose_name': 'track',
                'verbose_name_plural': 'tracks',
                'ordering': ['-is_catalogue', 'length_m'],
                'constraints': [models.CheckConstraint(condition=models.Q(('length_m__gt', 0)), name='track_length_positive'), models.CheckConstraint(condition=models.Q(('width_m__gt', 0)), name='track_width_positive'), models.CheckConstraint(condition=models.Q(models.Q(('corners__isnull', True), ('difficulty__isnull', True), ('is_catalogue', False), ('length_m__isnull', True), ('width_m__isnull', True)), models.Q(('corners__isnull', False), ('difficulty__isnull', False), ('length_m__isnull', False), ('width_m__isnull', False)), _connector='OR'), name='track_has_all_measures_or_no_shape'), models.CheckConstraint(condition=models.Q(('difficulty__lte', 100)), name='track_difficulty_at_most_100'), models.CheckConstraint(condition=models.Q(('direction__in', ['ccw', 'cw'])), name='track_direction_known'), models.CheckConstraint(condition=models.Q(('look__in', ['official', 'textures', 'bold'])), name='track_look_known')],
            },
        ),
    ]
