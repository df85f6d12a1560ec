"""The panels beside the road: the bar above, and below it title, order and small map."""

import math
from collections.abc import Sequence

import cv2
import numpy as np

from core.cards.lettering import shortened

from . import palette, shapes
from .brush import Sticker, disc, fill, fixed, rounded, stroke
from .lettering import Pen, figures, write
from .motion import fault_times
from .palette import Colour, mixed
from .scene import BAR, Words
from .timeline import FrameTimeline
from .timing import SECTORS, Clock, TimedLap, Timing, standings, written

MARGIN = 20
_STEER_DEG = 30.0
_MAP_W, _MAP_H = 250, 168
_TITLE_W = 380
_ROW_H = 30
_FINER = 4
_ORDER_EVERY_MS = 200.0  # gaps that change in every frame cannot be read


class Panel:
    """Paints everything that is not road onto a frame."""

    def __init__(self, take: FrameTimeline) -> None:
        self._take = take
        self._unit = unit = take.form.height / 720.0
        self._words = take.words
        self.height = round(BAR * unit)
        self._bar = np.empty((self.height, take.form.width, 3), np.uint8)
        self._wide = take.form.width / 1280.0
        self._blank_bar()
        self._map = SmallMap(take, round(_MAP_W * unit), round(_MAP_H * unit))
        self._title = self._head()
        self._order: tuple[float, list[tuple[int, float]]] = (-math.inf, [])
        self._before: dict[str, object] = {}
        self._faults = fault_times(take.hero.steps)

    def paint(self, picture: np.ndarray, frame: int) -> None:
        take, unit = self._take, self._unit
        margin = round(MARGIN * unit)
        moment = float(take.times[frame])
        hero = take.hero
        clock = hero.timing.at(moment, take.scene.lap)
        self._update(
            clock, self._resets(moment), float(hero.way.speed[frame]), math.degrees(float(hero.way.steer[frame]))
        )
        below = self.height
        picture[:below] = self._bar
        self._progress(picture, below, float(hero.way.done[frame]) - (clock.lap - 1))
        if len(take.actors) > 1:
            self._rows(moment)
        self._title.put(picture, margin, below + margin)
        self._map.paint(picture, take.form.width - self._map.width - margin, below + margin, frame)
        if clock.flash is not None and frame < take.driven:  # not under the card
            self._flash(picture, clock, below)

    def _x(self, x: float) -> float:
        return x * self._wide

    def _blank_bar(self) -> None:
        take, unit, bar = self._take, self._unit, self._bar
        bar[:] = palette.SURFACE
        bar[-max(1, round(unit)) :] = palette.LINE
        high = 44 * unit
        side = shapes.side(take.hero.car.shell)
        left = self._x(24)
        car_picture(bar, side, take.hero.colour, left, (self.height - high) / 2 + 2 * unit, high / 56)
        x = left + high / 56 * 120 + 16 * unit
        name = shortened(take.hero.car.name, 22 * unit, True, round(self._x(392) - x))
        write(bar, name, x, 17 * unit, Pen(22 * unit, palette.TEXT, bold=True))
        self._name_x = x
        words = self._words
        labels = ((words.last, 700, 15), (words.best, 700, 49), (words.speed, 912, 15), (words.steering, 1092, 15))
        for label, place, y in labels:
            write(bar, label.upper(), self._x(place), y * unit, Pen(13 * unit, palette.MUTED, bold=True))
        for place in (672, 884):
            x = round(self._x(place))
            bar[round(20 * unit) : round(72 * unit), x : x + max(1, round(unit))] = palette.LINE

    def _field(self, name: str, value: object, x: float, y: float, width: float, height: float) -> bool:
        """Whether the value of a field of the bar has changed; then the field is wiped."""
        if name in self._before and self._before[name] == value:
            return False
        self._before[name] = value
        self._bar[round(y) : round(y + height), round(x) : round(x + width)] = palette.SURFACE
        return True

    def _resets(self, moment: float) -> int:
        """The resets of the followed car so far, in the run or in the only lap that is shown."""
        take = self._take
        laps = [lap for lap in take.hero.timing.laps if take.scene.lap in (None, lap.number)]
        begun = laps[0].start_ms if laps else 0.0
        faults = int(((self._faults >= begun) & (self._faults <= moment)).sum())
        return min(faults, sum(lap.resets for lap in laps))  # the fault that ends a run is no reset

    def _update(self, clock: Clock, resets: int, speed: float, degrees: float) -> None:
        """Bring the bar up to date, writing changed fields only."""
        unit, words, bar = self._unit, self._words, self._bar
        lap = f"{words.lap} {clock.lap} / {clock.laps}" if clock.laps else f"{words.lap} {clock.lap}"
        if self._field("lap", lap, self._name_x, 48 * unit, self._x(392) - 116 * unit - self._name_x, 28 * unit):
            write(bar, lap, self._name_x, 50 * unit, Pen(17 * unit, palette.SOFT))
        time = written(clock.lap_ms)
        middle = self._x(532)
        if self._field("resets", resets, self._x(392) - 116 * unit, 48 * unit, 116 * unit, 28 * unit):
            colour = palette.SOFT if resets else palette.MUTED
            write(bar, f"{words.resets} {resets}", self._x(392), 50 * unit, Pen(17 * unit, colour, align="right"))
        if self._field("clock", time, middle - 130 * unit, 8 * unit, 260 * unit, 56 * unit):
            figures(bar, time, middle, 6 * unit, Pen(44 * unit, palette.TEXT, bold=True, align="middle"))
        if self._field("sectors", (clock.sectors, clock.lap), middle - 110 * unit, 70 * unit, 220 * unit, 10 * unit):
            width = (204 * unit - (SECTORS - 1) * 5 * unit) / SECTORS
            sector_bars(bar, clock.sectors, middle - 102 * unit, 71 * unit, width, 6 * unit, 5 * unit)
        for name, value, y, colour in (
            ("last", clock.last_ms, 10, palette.TEXT),
            ("best", clock.best_ms, 44, palette.SECTORS["green"]),
        ):
            if self._field(name, value, self._x(752), y * unit, self._x(124), 32 * unit):
                colour = colour if value is not None else palette.MUTED
                figures(bar, written(value), self._x(868), y * unit, Pen(20 * unit, colour, bold=True, align="right"))
        text = f"{speed:.1f} m/s"
        if self._field("speed", text, self._x(912), 34 * unit, self._x(150), 30 * unit):
            figures(bar, text, self._x(912), 33 * unit, Pen(20 * unit, palette.TEXT, bold=True))
        text = f"{degrees:+.0f}°".replace("+0", "0").replace("-0", "0") if round(degrees) == 0 else f"{degrees:+.0f}°"
        if self._field("steering", text, self._x(1092), 34 * unit, self._x(164), 30 * unit):
            figures(bar, text.replace("°", ""), self._x(1092), 33 * unit, Pen(20 * unit, palette.TEXT, bold=True))
        self._gauges(speed, degrees)

    def _gauges(self, speed: float, degrees: float) -> None:
        bar, unit = self._bar, self._unit
        now = (round(speed, 2), round(degrees, 1))
        if self._before.get("gauges") == now:
            return
        self._before["gauges"] = now
        y, high = 69 * unit, 6 * unit
        x, width = self._x(912), self._x(148)
        bar[round(y - 6 * unit) : round(y + high + 7 * unit), round(x - 8 * unit) :] = palette.SURFACE
        fill(bar, [rounded(width, high, high / 2, x, y)], palette.LINE)
        share = min(max(speed / 4.0, 0.0), 1.0)
        if share * width > 1.0:
            filled = rounded(max(round(share * width, 1), high), high, high / 2, x, y)
            fill(bar, [filled], palette.SPEEDS[palette.speed_class(speed)])
        x, width = self._x(1092), self._x(164)
        fill(bar, [rounded(width, high, high / 2, x, y)], palette.LINE)
        middle = x + width / 2
        # to the left on the gauge is to the left of the car
        hand = middle - min(max(degrees / _STEER_DEG, -1.0), 1.0) * (width / 2 - 3 * unit)
        low, top = sorted((middle, hand))
        fill(bar, [np.array([(low, y), (top, y), (top, y + high), (low, y + high)])], palette.BOT)
        tick = np.array([(middle, y - 4 * unit), (middle, y + high + 3 * unit)])
        stroke(bar, [tick], palette.MUTED, unit, closed=False)
        disc(bar, hand, y + high / 2, 6 * unit, palette.TEXT)

    def _progress(self, picture: np.ndarray, below: int, share: float) -> None:
        """Paint the driven share of the lap along the bar's lower edge."""
        thick = max(2, round(3 * self._unit))
        picture[below - thick : below, : round(min(max(share, 0.0), 1.0) * self._take.form.width)] = palette.ACCENT

    def _head(self) -> Sticker:
        """The card with the title, and room for the order of a duel."""
        take, unit = self._take, self._unit
        several = len(take.actors) > 1
        pad = 16 * unit
        room = round(_TITLE_W * unit - 2 * pad)
        title = shortened(take.scene.title, 20 * unit, True, room)
        subtitle = shortened(take.scene.subtitle, 14 * unit, False, room)
        high = (64 if several or subtitle else 42) * unit
        high += (12 + len(take.actors) * _ROW_H) * unit if several else 0
        card = Sticker.card(round(_TITLE_W * unit), round(high), 10 * unit, palette.SURFACE, palette.LINE)
        used = write(card.pixels, title, pad, 9 * unit, Pen(20 * unit, palette.TEXT, bold=True))
        used = max(used, write(card.pixels, subtitle, pad, 36 * unit, Pen(14 * unit, palette.MUTED)))
        if several:
            card.pixels[round(66 * unit) : round(66 * unit) + max(1, round(unit)), 1:-1] = palette.LINE
            return card
        narrow = Sticker.card(round(used + 2 * pad), round(high), 10 * unit, palette.SURFACE, palette.LINE)
        inside = round(used + pad)
        narrow.pixels[2:-2, round(pad) : inside] = card.pixels[2:-2, round(pad) : inside]
        return narrow

    def _rows(self, moment: float) -> None:
        unit, take = self._unit, self._take
        if not 0.0 <= moment - self._order[0] < _ORDER_EVERY_MS:
            self._order = (moment, standings([actor.steps for actor in take.actors], moment))
        elif self._before.get("order") is self._order:
            return
        self._before["order"] = self._order
        pixels = self._title.pixels
        for number, (index, behind) in enumerate(self._order[1]):
            actor = take.actors[index]
            y = (70 + number * _ROW_H) * unit
            row = pixels[round(y) : round(y + _ROW_H * unit), 2:-2]
            row[:] = palette.SURFACE
            x = 16 * unit
            faded = actor.drive is None or moment > actor.steps.t[-1]
            colour = palette.MUTED if faded else palette.TEXT
            figures(pixels, str(number + 1), x, y + 4 * unit, Pen(16 * unit, palette.MUTED, bold=True))
            disc(pixels, x + 30 * unit, y + _ROW_H * unit / 2, 6 * unit, actor.colour)
            name = shortened(actor.car.name, 16 * unit, actor is take.hero, round(220 * unit))
            write(pixels, name, x + 46 * unit, y + 4 * unit, Pen(16 * unit, colour, bold=actor is take.hero))
            gap = f"+{behind:.1f}" if number else ""
            figures(pixels, gap, pixels.shape[1] - x, y + 4 * unit, Pen(16 * unit, palette.SOFT, align="right"))

    def _flash(self, picture: np.ndarray, clock: Clock, below: int) -> None:
        lap, unit, timing = clock.flash, self._unit, self._take.hero.timing
        assert lap is not None, "there is one to show"
        key = ("flash", lap.number)
        if self._before.get("flash") != key:
            self._before["flash"] = key
            self._flash_card = flash_card(self._words, lap, timing, unit)
        age = clock.flash_age_ms
        strength = min(1.0, age / 160.0, (2600.0 - age) / 400.0)
        card = self._flash_card
        rise = round((1.0 - min(1.0, age / 220.0)) ** 2 * 18 * unit)
        left = (picture.shape[1] - card.cover.shape[1]) // 2
        card.put(picture, left, below + round(MARGIN * unit) - rise, strength)


def flash_card(words: Words, lap: TimedLap, timing: Timing, unit: float) -> Sticker:
    """A completed lap: its number, time, gap to the best lap before and sectors."""
    before = timing.was_best(lap)
    better = before is None or lap.time_ms <= before
    card = Sticker.card(round(470 * unit), round(76 * unit), 10 * unit, palette.SURFACE, palette.LINE)
    pixels = card.pixels
    write(pixels, f"{words.lap} {lap.number}", 20 * unit, 22 * unit, Pen(18 * unit, palette.SOFT, bold=True))
    colour = palette.SECTORS["green" if better else "yellow"]
    figures(pixels, written(lap.time_ms), 235 * unit, 8 * unit, Pen(38 * unit, colour, bold=True, align="middle"))
    if before is not None:
        gap = (lap.time_ms - before) / 1000.0
        text = f"{gap:+.3f}"
        figures(pixels, text, 450 * unit, 22 * unit, Pen(18 * unit, colour, bold=True, align="right"))
    sector_bars(pixels, timing.live(lap), 133 * unit, 60 * unit, 66 * unit, 5 * unit, 4 * unit)
    return card


def sector_bars(
    picture: np.ndarray, colours: Sequence[str], x: float, y: float, width: float, height: float, gap: float
) -> None:
    """A bar for each sector of a lap; ``width``: of one bar; ``colours``: of the sectors driven."""
    for number in range(SECTORS):
        colour = palette.SECTORS.get(colours[number], palette.LINE) if number < len(colours) else palette.LINE
        fill(picture, [rounded(width, height, height / 2, x + number * (width + gap), y)], colour)


def car_picture(picture: np.ndarray, side: shapes.Side, colour: Colour, left: float, top: float, scale: float) -> None:
    """A shell from the side; ``scale``: px a unit."""

    def outlines(parts: list[np.ndarray]) -> list[np.ndarray]:
        return [part * scale + (left, top) for part in parts]

    fill(picture, outlines(side.body), colour)
    fill(picture, outlines(side.dark), palette.bgr("#05070a"))
    stroke(picture, outlines(side.dark), palette.LINE_STRONG, 1)
    fill(picture, outlines(side.glass), palette.bgr("#3d5468"))
    for x, y, radius in side.wheels:
        at = (left + x * scale, top + y * scale)
        disc(picture, *at, radius * scale, palette.bgr("#05070a"))
        disc(picture, *at, radius * scale, palette.bgr("#59636f"), 1)
        disc(picture, *at, radius * 0.45 * scale, palette.bgr("#8c97a3"))


class SmallMap:
    """The whole track in a corner, with a dot for every car."""

    def __init__(self, take: FrameTimeline, width: int, height: int) -> None:
        self._take = take
        self._unit = take.form.height / 720.0
        track = take.scene.track
        x_min, y_min, x_max, y_max = track.bounds
        pad = 16 * self._unit
        wide, high = max(x_max - x_min, 0.1), max(y_max - y_min, 0.1)
        self._scale = min((width - 2 * pad) / wide, (height - 2 * pad) / high)
        # a card no larger than the track needs
        width = max(round(wide * self._scale + 2 * pad), round(96 * self._unit))
        height = max(round(high * self._scale + 2 * pad), round(72 * self._unit))
        self.width, self.height = width, height
        self._middle = np.array(((x_min + x_max) / 2, (y_min + y_max) / 2))
        self._card = Sticker.card(width, height, 10 * self._unit, palette.SURFACE, palette.LINE)
        large = cv2.resize(self._card.pixels, None, fx=_FINER, fy=_FINER, interpolation=cv2.INTER_NEAREST)
        ring = [fixed(self._place(line) * _FINER) for line in reversed(track.outlines)]
        cv2.fillPoly(large, ring, mixed(palette.ROAD, palette.ROAD_LINE, 0.1), cv2.LINE_AA, 4)
        cv2.polylines(large, ring, True, palette.LINE_STRONG, round(1.6 * _FINER * self._unit), cv2.LINE_AA, 4)
        left, right = track.half_widths_at(track.finish_m)
        ends = np.array([track.point_at(track.finish_m, side)[:2] for side in (left, -right)])
        middle = ends.mean(axis=0)
        least = max(1.0, 7.0 * self._unit / max(self._scale * (left + right) / 2, 1e-6))
        finish = fixed(self._place((ends - middle) * least + middle) * _FINER)
        cv2.polylines(large, [finish], False, palette.TEXT, round(2.4 * _FINER * self._unit), cv2.LINE_AA, 4)
        small = cv2.resize(large, (width, height), interpolation=cv2.INTER_AREA)
        self._card.pixels[2:-2, 2:-2] = small[2:-2, 2:-2]
        for x, y, _ in take.boxes:
            at = self._place(np.array((x, y)))
            corner = 3 * self._unit
            square = np.array([(-corner, -corner), (corner, -corner), (corner, corner), (-corner, corner)])
            fill(self._card.pixels, [square + at], palette.BOX)

    def _place(self, points: np.ndarray) -> np.ndarray:
        return (points - self._middle) * (self._scale, -self._scale) + (self.width / 2, self.height / 2)

    def paint(self, picture: np.ndarray, left: int, top: int, frame: int) -> None:
        self._card.put(picture, left, top)
        take, unit = self._take, self._unit
        at = np.array((left, top))
        for bot in take.bots:
            x, y = self._place(bot[frame, :2]) + at
            disc(picture, x, y, 3.5 * unit, palette.BOT)
        for actor in sorted(take.actors, key=lambda actor: actor is take.hero):
            if actor.drive is None:
                continue
            x, y = self._place(np.array((actor.drive.x[frame], actor.drive.y[frame]))) + at
            x, y = min(max(x, left + 4), left + self.width - 4), min(max(y, top + 4), top + self.height - 4)
            disc(picture, x, y, (7 if actor is take.hero else 6) * unit, palette.TEXT)
            disc(picture, x, y, (5 if actor is take.hero else 4.2) * unit, actor.colour)
