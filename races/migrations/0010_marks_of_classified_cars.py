"""Fastest times are of classified runs alone: those that others had set are worked out anew."""

from typing import Any

from django.db import migrations
from django.db.models import Min

from races.ranking import RULES, best_of_sectors

OWN = ("own_lap_ms", "own_sector_1_ms", "own_sector_2_ms", "own_sector_3_ms")
FASTEST = ("fastest_lap_ms", "fastest_sector_1_ms", "fastest_sector_2_ms", "fastest_sector_3_ms")


def mend_marks(apps: Any, schema_editor: Any) -> None:
    """Write the fastest times of racers and races as if only classified runs had ever set any.

    Where a racer sent a car only once, theirs are of the run that stands on the board; a record holds no others.
    """
    Entry, Race = apps.get_model("races", "Entry"), apps.get_model("races", "Race")
    Submission = apps.get_model("races", "Submission")
    several = Entry.objects.filter(classified=True, last_number__gt=1, race__imported_at=None)
    for entry in several.select_related("race").order_by("pk").iterator(chunk_size=500):
        runs = Submission.objects.filter(entry=entry, is_void=False, evaluation__result__isnull=False)
        rule = RULES[entry.race.ranking_method]
        standings = [
            rule.standing(laps, entry.race.minimum_laps)
            for laps in runs.order_by("pk").values_list("evaluation__result__laps", flat=True)
        ]
        counted = [one for one in standings if one.classified]
        if not counted:
            continue
        sectors = best_of_sectors(one.best_sectors for one in counted) or (None, None, None)
        own = dict(zip(OWN, (min(one.best_lap_ms for one in counted), *sectors), strict=True))
        if own != {name: getattr(entry, name) for name in OWN}:
            Entry.objects.filter(pk=entry.pk).update(**own)
    for race in Race.objects.exclude(fastest_lap_ms=None, fastest_sector_1_ms=None).order_by("pk"):
        ranked = Entry.objects.filter(race=race, is_baseline=False, withdrawn_at=None, classified=True)
        least = ranked.aggregate(**{f"least_{name}": Min(name) for name in OWN})
        fastest = {name: least[f"least_{own}"] for name, own in zip(FASTEST, OWN, strict=True)}
        if fastest != {name: getattr(race, name) for name in FASTEST}:
            Race.objects.filter(pk=race.pk).update(**fastest)


class Migration(migrations.Migration):
    dependencies = [("races", "0009_one_list_of_defaults"), ("evaluation", "0006_shared_models")]

    operations = [migrations.RunPython(mend_marks, migrations.RunPython.noop)]
