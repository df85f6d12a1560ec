from django.db import migrations, models
from django.db.models import F


def end_what_is_over(apps, schema_editor):
    """What was sent or given up ended when it was to be tried next, and pauses no more."""
    deliveries = apps.get_model("league", "WebhookDelivery").objects.exclude(state="due")
    deliveries.update(ended_at=F("not_before"), not_before=None)


class Migration(migrations.Migration):
    dependencies = [("league", "0002_no_announcements")]

    operations = [
        migrations.RemoveIndex(model_name="webhookdelivery", name="delivery_due"),
        migrations.RemoveConstraint(model_name="webhookdelivery", name="delivery_state_known"),
        migrations.RenameField(model_name="webhookdelivery", old_name="tries", new_name="attempt"),
        migrations.RenameField(model_name="webhookdelivery", old_name="next_at", new_name="not_before"),
        migrations.AddField(
            model_name='webhookdelivery',
            name='ended_at',
            field=models.DateTimeField(blank=True, null=True, verbose_name='ended'),
        ),
        migrations.AddField(
            model_name='webhookdelivery',
            name='lease',
            field=models.UUIDField(blank=True, editable=False, null=True, verbose_name='lease'),
        ),
        migrations.AddField(
            model_name='webhookdelivery',
            name='leased_until',
            field=models.DateTimeField(blank=True, null=True, verbose_name='leased until'),
        ),
        migrations.AddField(
            model_name='webhookdelivery',
            name='started_at',
            field=models.DateTimeField(blank=True, null=True, verbose_name='started'),
        ),
        migrations.AddField(
            model_name='webhookdelivery',
            name='worker',
            field=models.CharField(blank=True, db_default='', default='', max_length=128, verbose_name='worker'),
        ),
        migrations.AlterField(
            model_name='webhookdelivery',
            name='attempt',
            field=models.PositiveSmallIntegerField(db_default=0, default=0, verbose_name='attempt'),
        ),
        migrations.AlterField(
            model_name='webhookdelivery',
            name='not_before',
            field=models.DateTimeField(blank=True, null=True, verbose_name='pauses until'),
        ),
        migrations.AlterField(
            model_name='webhookdelivery',
            name='state',
            field=models.CharField(default='due', max_length=8, verbose_name='state'),
        ),
        migrations.RunPython(end_what_is_over, migrations.RunPython.noop),
        migrations.AddIndex(
            model_name='webhookdelivery',
            index=models.Index(condition=models.Q(('state', 'due')), fields=['not_before'], name='delivery_due'),
        ),
        migrations.AddIndex(
            model_name='webhookdelivery',
            index=models.Index(condition=models.Q(('state', 'sending')), fields=['leased_until'], name='delivery_leases'),
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
