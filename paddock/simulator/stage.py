"""A track with its world and cars, shared by races and Gymnasium environments."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import cached_property

from paddock.geometry.track import TrackGeometry
from paddock.rules.race import RaceRules

from .action import Action
from .bots import Bots, LanePaths
from .camera.theme import OFFICIAL, Theme
from .camera.view import Scene
from .car import Pose
from .competitor import Competitor
from .layout import lay_out, refuse_open
from .physics import PADDOCK_CAR, CarPhysics
from .progress import Reach, clear_distance
from .referee import Referee
from .sensors import Reading, make_sensors
from .solids import Solid, car
from .traffic import Traffic
from .world import World, new_world


class PreparedTrack:
    """A track in the driven direction with everything that its runs share."""

    def __init__(self, track: TrackGeometry, direction: str = "ccw", theme: Theme = OFFICIAL) -> None:
        self.track = track.in_direction(direction)
        self.theme = theme
        self._readings: dict[object, dict[str, Reading]] = {}

    @cached_property
    def scene(self) -> Scene:
        """Drawn on first use."""
        return Scene.of(self.track, self.theme)

    def readings(self, sensors: Sequence[str], lidar_config: Mapping[str, float] | None = None) -> dict[str, Reading]:
        """:func:`paddock.simulator.sensors.make_sensors`, cached for all cars with the same sensors."""
        key = tuple(sensors), tuple(sorted((lidar_config or {}).items()))
        if key not in self._readings:
            self._readings[key] = make_sensors(sensors, lambda: self.scene, lidar_config)
        return self._readings[key]

    @cached_property
    def reach(self) -> Reach:
        return Reach(self.track)

    @cached_property
    def clear_m(self) -> float:
        return clear_distance(self.track)

    @cached_property
    def lanes(self) -> LanePaths:
        return LanePaths(self.track)


class Simulation:
    """One run: a fresh world, the layout with its boxes and bots, and the competitors. Use it as a context manager or
    call :meth:`close`."""

    def __init__(
        self, ground: PreparedTrack, rules: RaceRules, physics: CarPhysics = PADDOCK_CAR, world: World | None = None
    ) -> None:
        """``world``: of the same ``physics``, shared by several stages, whose cars neither meet nor see each other; its
        owner moves it between :meth:`command` and :meth:`judge` of all stages, and closes it.

        Raises UserFault as :func:`paddock.simulator.layout.lay_out`.
        """
        self.ground = ground
        self.competitors: list[Competitor] = []
        self._lay(rules, physics.control_hz)
        self.world = world or new_world(physics)
        self._shared = world is not None

    def _lay(self, rules: RaceRules, control_hz: float) -> None:
        ground = self.ground
        self.rules = rules
        self.layout = lay_out(ground.track, rules)
        self.bots = Bots(ground.lanes, rules, control_hz) if rules.bots else None
        self.bot_rows: list[tuple[Pose, ...]] = []  # where the bots were at each row of the first competitor's trace
        self._traffic = Traffic(ground.track.length, self.competitors, self.bots)
        self._box_solids = tuple(box.solid for box in self.layout.boxes)
        self._solids = self._standing_solids()

    def _standing_solids(self) -> tuple[Solid, ...]:
        return self._box_solids if self.bots is None else self._box_solids + self.bots.solids

    def add(
        self,
        sensors: Sequence[str],
        start_m: float = 0.0,
        lidar_config: Mapping[str, float] | None = None,
        *,
        grid: int | None = None,
    ) -> Competitor:
        """A car on the centre line, its base ``start_m`` metres after the finish, or as near as boxes and bots leave
        room; its laps begin and end there. ``grid``: its place on the starting grid behind that line, from 0.

        Raises UserFault ``track_needs_loop`` for a grid on an open track.
        """
        ground = self.ground
        if grid is not None:
            refuse_open(ground.track)
        mine: Competitor | None = None
        referee = Referee(
            ground.track,
            self.rules,
            self.world.physics,
            ground.reach,
            start_m,
            ground.clear_m,
            layout=self.layout,
            free=self._traffic.free_for(lambda: mine),
            grid=grid,
        )
        readings = ground.readings(sensors, lidar_config)
        mine = Competitor(self.world.add_car(), referee, readings, self.solids)
        self.competitors.append(mine)
        return mine

    def clear(self, rules: RaceRules | None = None) -> None:
        """Take all cars off the track and lay it out for another run, which equals one on a new stage."""
        self.vacate()
        self._lay(rules or self.rules, self.world.physics.control_hz)

    def vacate(self) -> None:
        for competitor in self.competitors:
            if competitor.car in self.world.cars:
                self.world.give_back(competitor.car)
        self.competitors.clear()

    def solids(self, competitor: Competitor) -> tuple[Solid, ...]:
        """The blocks that ``competitor`` can see: boxes in driving order, bots, then other cars on the track in the
        order in which they were added."""
        if len(self.competitors) == 1:
            return self._solids
        return self._solids + tuple(
            car(*other.referee.pose) for other in self.competitors if other is not competitor and not other.done
        )

    def step(self, actions: Sequence[Action | None]) -> None:
        """One control step. ``actions``: one for each competitor, None for those that pause or are done."""
        if self.bots is None and len(self.competitors) == 1:
            self._step_alone(*actions)
            return
        if self.command(actions):  # while all cars stand the world stands
            self.world.step()
        self.judge()

    def _step_alone(self, action: Action | None) -> None:
        """The same for one car without bots, faster."""
        competitor = self.competitors[0]
        referee = competitor.referee
        if referee.end_reason is not None:
            return
        if referee.pause_steps > 0:
            competitor.stand()
        else:
            assert action is not None, "a driving car needs an action"
            competitor.command(action)
            self.world.step()
        competitor.move()
        competitor.judge()

    def command(self, actions: Sequence[Action | None]) -> bool:
        """The first part of a step: hand out the actions. True where a car drives, so that the world must move."""
        competitors = self.competitors
        if self.bots is not None and not competitors[0].done:
            self.bot_rows.append(self.bots.poses)
        driving = False
        for competitor, action in zip(competitors, actions, strict=True):
            if competitor.done:
                continue
            if competitor.pausing:
                competitor.stand()
            else:
                assert action is not None, "a driving car needs an action"
                competitor.command(action)
                driving = True
        return driving

    def judge(self) -> None:
        """The last part of a step: move the bots and judge every car."""
        competitors = self.competitors
        if self.bots is None and len(competitors) == 1:
            competitor = competitors[0]
            if not competitor.done:
                competitor.move()
                competitor.judge()
        else:
            self._judge_all()

    def retire(self, competitor: Competitor) -> None:
        """Take a car off the track and end its run; its laps stand."""
        competitor.retire()
        self._leave(competitor)

    def _judge_all(self) -> None:
        """Move all bots and cars, then judge the contacts between them, then each car."""
        self._traffic.step()
        self._solids = self._standing_solids()
        active = [competitor for competitor in self.competitors if not competitor.done]
        for competitor in active:
            competitor.move()
        rammed = self._traffic.rammed()
        for competitor, fault in zip(self.competitors, rammed, strict=True):
            if competitor.done:
                continue
            paused = competitor.pausing
            competitor.judge(fault)
            if competitor.done:
                self._leave(competitor)
            elif paused and not competitor.pausing:
                # the world may have moved, and a car at rest settles by some micrometres
                competitor.car.place(competitor.referee.pose)

    def _leave(self, competitor: Competitor) -> None:
        if competitor is self.competitors[0] and self.bots is not None:
            self.bot_rows.append(self.bots.poses)
        if len(self.competitors) > 1:
            self.world.remove_car(competitor.car)

    def close(self) -> None:
        """Free the world, unless it is shared."""
        if not self._shared:
            self.world.close()

    def __enter__(self) -> Simulation:
        return self

    def __exit__(self, *_exception: object) -> None:
        self.close()
