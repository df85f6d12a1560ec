"""The result card at the end of a video."""

from typing import NamedTuple

import numpy as np

from core.cards.lettering import mask, shortened

from . import palette, shapes
from .brush import Sticker, disc
from .lettering import Pen, figures, write
from .panel import car_picture, sector_bars
from .scene import Words
from .timeline import Actor, FrameTimeline
from .timing import SECTORS, TimedLap, written

_WIDTH, _PAD, _ROW = 620, 28, 34
_MOST_ROWS = 8
_HEAD, _FOOT = 104, 92


class Figure(NamedTuple):
    """A large time at the foot of the card."""

    label: str
    value: str
    colour: palette.Colour


def result_card(take: FrameTimeline, words: Words) -> Sticker:
    unit = take.form.height / 720.0
    several = len(take.actors) > 1 and take.scene.lap is None
    cars = _in_order(take) if several else []
    laps = [] if several else _laps(take)
    shown: list[Actor] | list[TimedLap] = cars[:_MOST_ROWS] if several else _fastest(laps)
    missing = len(cars) + len(laps) - len(shown)
    high = _HEAD + _ROW * len(shown) + (_ROW if missing else 0) + _FOOT
    card = Sticker.card(round(_WIDTH * unit), round(high * unit), 14 * unit, palette.SURFACE, palette.LINE_STRONG)
    pixels = card.pixels
    _head(pixels, take, unit)
    for number, row in enumerate(shown):
        y = (_HEAD + number * _ROW) * unit
        if isinstance(row, Actor):
            _car_row(pixels, number + 1, row, y, unit, words)
        elif isinstance(row, TimedLap):
            _lap_row(pixels, row, take.hero, y, unit, words)
    if missing:
        y = (_HEAD + len(shown) * _ROW + 4) * unit
        text = f"+ {missing}"
        write(pixels, text, _PAD * unit, y, Pen(16 * unit, palette.MUTED))
    _foot(pixels, _figures(take, words), (high - _FOOT) * unit, unit)
    return card


def caption(take: FrameTimeline) -> Sticker:
    unit = take.form.height / 720.0
    size, pad = 24 * unit, 16 * unit
    text = shortened(take.scene.caption, size, True, round(take.form.width - 120 * unit))
    wide = mask(text, size, True).shape[1] + 2 * pad
    sticker = Sticker.card(round(wide), round(52 * unit), 10 * unit, palette.SURFACE, palette.LINE_STRONG)
    write(sticker.pixels, text, pad, 9 * unit, Pen(size, palette.TEXT, bold=True))
    return sticker


def _in_order(take: FrameTimeline) -> list[Actor]:
    places = {number: place for place, number in enumerate(take.scene.order)}
    return sorted(take.actors, key=lambda actor: places.get(actor.car.number, len(places)))


def _laps(take: FrameTimeline) -> list[TimedLap]:
    return [lap for lap in take.hero.timing.laps if take.scene.lap in (None, lap.number)]


def _fastest(laps: list[TimedLap]) -> list[TimedLap]:
    """The fastest laps that the card has room for, in the order in which they were driven."""
    best = sorted(laps, key=lambda lap: (not lap.complete, lap.time_ms))[:_MOST_ROWS]
    return sorted(best, key=lambda lap: lap.number)


def _head(pixels: np.ndarray, take: FrameTimeline, unit: float) -> None:
    left = pixels.shape[1] - (_PAD + 120) * unit
    car_picture(pixels, shapes.side(take.hero.car.shell), take.hero.colour, left, 22 * unit, unit)
    room = round(left - (_PAD + 16) * unit)
    name = shortened(take.hero.car.name, 26 * unit, True, room)
    write(pixels, name, _PAD * unit, 20 * unit, Pen(26 * unit, palette.TEXT, bold=True))
    title = shortened(take.scene.title, 15 * unit, False, room)
    write(pixels, title, _PAD * unit, 57 * unit, Pen(15 * unit, palette.MUTED))
    _rule(pixels, 92 * unit, unit)


def _rule(pixels: np.ndarray, y: float, unit: float) -> None:
    pixels[round(y) : round(y) + max(1, round(unit)), round(_PAD * unit) : -round(_PAD * unit)] = palette.LINE


def _lap_row(pixels: np.ndarray, lap: TimedLap, hero: Actor, y: float, unit: float, words: Words) -> None:
    best = min((one.time_ms for one in hero.timing.laps if one.complete), default=None)
    colour = palette.SECTORS["green"] if lap.complete and lap.time_ms == best else palette.TEXT
    if not lap.complete:
        colour = palette.MUTED
    text = f"{words.lap} {lap.number}"
    write(pixels, text, _PAD * unit, y + 6 * unit, Pen(17 * unit, palette.SOFT))
    figures(pixels, written(lap.time_ms), 236 * unit, y + 5 * unit, Pen(19 * unit, colour, bold=True, align="right"))
    sector_bars(pixels, hero.timing.final(lap), 270 * unit, y + 15 * unit, 52 * unit, 7 * unit, 6 * unit)
    counts = [(words.off_tracks, lap.off_tracks), (words.crashes, lap.crashes), (words.resets, lap.resets)]
    text = next((f"{word} {count}" for word, count in counts if count), "")
    write(pixels, text, pixels.shape[1] - _PAD * unit, y + 7 * unit, Pen(15 * unit, palette.MUTED, align="right"))


def _car_row(pixels: np.ndarray, place: int, actor: Actor, y: float, unit: float, words: Words) -> None:
    complete = [lap.time_ms for lap in actor.timing.laps if lap.complete]
    figures(pixels, str(place), _PAD * unit, y + 5 * unit, Pen(19 * unit, palette.MUTED, bold=True))
    disc(pixels, (_PAD + 36) * unit, y + 17 * unit, 7 * unit, actor.colour)
    name = shortened(actor.car.name, 18 * unit, True, round(250 * unit))
    write(pixels, name, (_PAD + 54) * unit, y + 6 * unit, Pen(18 * unit, palette.TEXT, bold=True))
    best, total = min(complete, default=None), sum(lap.time_ms for lap in actor.timing.laps)
    for value, x, colour in ((best, 450, palette.SECTORS["green"]), (total or None, _WIDTH - _PAD, palette.TEXT)):
        figures(pixels, written(value), x * unit, y + 5 * unit, Pen(18 * unit, colour, bold=True, align="right"))


def _figures(take: FrameTimeline, words: Words) -> list[Figure]:
    hero = take.hero
    laps = _laps(take)
    if take.scene.lap is not None:
        (lap,) = laps
        names = [f"S{number + 1}" for number in range(len(lap.sector_ms))]
        colours = hero.timing.final(lap)
        return [
            Figure(name, f"{time / 1000.0:.3f}", palette.SECTORS.get(colour, palette.TEXT))
            for name, time, colour in zip(names, lap.sector_ms, colours, strict=True)
        ]
    complete = [lap.time_ms for lap in laps if lap.complete]
    total = sum(lap.time_ms for lap in laps)
    best = min(complete, default=None)
    average = sum(complete) // len(complete) if complete else None
    return [
        Figure(words.best, written(best), palette.SECTORS["green"]),
        *([] if average == best else [Figure(words.average, written(average), palette.TEXT)]),
        Figure(words.total, written(total if laps else None), palette.TEXT),
    ]


def _foot(pixels: np.ndarray, entries: list[Figure], y: float, unit: float) -> None:
    _rule(pixels, y + 6 * unit, unit)
    width = (pixels.shape[1] - 2 * _PAD * unit) / SECTORS
    for number, figure in enumerate(entries):
        x = _PAD * unit + number * width
        label = figure.label.upper()
        write(pixels, label, x, y + 17 * unit, Pen(13 * unit, palette.MUTED, bold=True))
        figures(pixels, figure.value, x, y + 36 * unit, Pen(30 * unit, figure.colour, bold=True))
