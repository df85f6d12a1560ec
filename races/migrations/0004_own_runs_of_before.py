"""Test drives of trainings from before there were own runs become own runs, so that their racers find them."""

from typing import Any

from django.db import migrations

AT_ONCE = 500
USUAL_LAPS = 3


def take_over(apps: Any, schema_editor: Any) -> None:
    Evaluation = apps.get_model("evaluation", "Evaluation")
    OwnEvaluation = apps.get_model("races", "OwnEvaluation")
    drives = Evaluation.objects.filter(submission=None, duel=None, redrive=None, replaced_by=None, own=None)
    rows = []
    for drive in drives.only("owner", "spec", "queued_at").order_by("pk").iterator(chunk_size=AT_ONCE):
        laps = drive.spec["rules"].get("laps", USUAL_LAPS)
        rows.append(
            OwnEvaluation(
                owner_id=drive.owner_id,
                evaluation_id=drive.pk,
                ranking_method="average",
                minimum_laps=max(1, min(USUAL_LAPS, laps)),
                asked_at=drive.queued_at,
            )
        )
    OwnEvaluation.objects.bulk_create(rows, batch_size=AT_ONCE)


class Migration(migrations.Migration):
    dependencies = [("races", "0003_prizes_and_terms")]

    operations = [migrations.RunPython(take_over, migrations.RunPython.noop)]
