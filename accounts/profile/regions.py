"""Regions of the world and their countries: the site's default list or the operator's (PADDOCK_REGIONS)."""

import re
from functools import lru_cache

from django.conf import settings
from django.utils.translation import gettext

from paddock.errors.reasons import gettext_noop  # Django's asks for settings, which read this

# The regions of the United Nations' standard M49, with Taiwan and Kosovo beside their neighbours; Antarctica in none.
USUAL: dict[str, str] = {
    gettext_noop("Africa"): """
        DZ EG EH LY MA SD TN AO BF BI BJ BW CD CF CG CI CM CV DJ ER ET GA GH GM GN GQ GW IO KE KM LR LS MG
        ML MR MU MW MZ NA NE NG RE RW SC SH SL SN SO SS ST SZ TD TF TG TZ UG YT ZA ZM ZW""",
    gettext_noop("North America"): "BM CA GL PM US",
    gettext_noop("Latin America and the Caribbean"): """
        AG AI AR AW BB BL BO BQ BR BS BV BZ CL CO CR CU CW DM DO EC FK GD GF GP GS GT GY HN HT JM KN KY LC
        MF MQ MS MX NI PA PE PR PY SR SV SX TC TT UY VC VE VG VI""",
    gettext_noop("Asia"): """
        AE AF AM AZ BD BH BN BT CN CY GE HK ID IL IN IQ IR JO JP KG KH KP KR KW KZ LA LB LK MM MN MO MV MY
        NP OM PH PK PS QA SA SG SY TH TJ TL TM TR TW UZ VN YE""",
    gettext_noop("Europe"): """
        AD AL AT AX BA BE BG BY CH CZ DE DK EE ES FI FO FR GB GG GI GR HR HU IE IM IS IT JE LI LT LU LV MC
        MD ME MK MT NL NO PL PT RO RS RU SE SI SJ SK SM UA VA XK""",
    gettext_noop("Oceania"): """
        AS AU CC CK CX FJ FM GU HM KI MH MP NC NF NR NU NZ PF PG PN PW SB TK TO TV UM VU WF WS""",
}
MOST_NAME = 64


def regions_in(text: str) -> dict[str, str]:
    """Regions by country code, from ``Name: KR JP; Other name: DE FR``; the default list for "". Raises ValueError."""
    if not text.strip():
        return {code: name for name, codes in USUAL.items() for code in codes.split()}
    found: dict[str, str] = {}
    names: set[str] = set()
    for part in filter(str.strip, text.split(";")):
        name, colon, codes = (each.strip() for each in part.partition(":"))
        if not (colon and name and codes) or len(name) > MOST_NAME or not name.isprintable() or name in names:
            raise ValueError(f"{part.strip()!r} is not a name of its own, a colon and countries' codes")
        names.add(name)
        for code in re.split(r"[\s,]+", codes):
            if not is_country(code):
                raise ValueError(f"{code!r} is not the code of a country, such as KR")
            if code in found:
                raise ValueError(f"{code} is in two regions")
            found[code] = name
    return found


def is_country(code: str) -> bool:
    """Whether it is the code of a country that racers may name. Asked before there are settings."""
    from django_countries.data import COUNTRIES

    return code in COUNTRIES or code == "XK"


def region_of(country: str) -> str:
    """The name of a country's region; ``""`` where it is in none."""
    return _by_country(settings.REGIONS).get(country, "")


def countries_of(region: str) -> list[str]:
    """The codes of a region's countries; none of what is no region."""
    return [code for code, name in _by_country(settings.REGIONS).items() if name == region]


def all_regions() -> list[str]:
    return list(dict.fromkeys(_by_country(settings.REGIONS).values()))


def region_name(name: str) -> str:
    """A region's name in the reader's language, or as the operator named it."""
    return gettext(name) if name in USUAL else name


@lru_cache(maxsize=8)
def _by_country(text: str) -> dict[str, str]:
    return regions_in(text)
