"""A racer's reward function: loads its text, calls it, and names each of its faults. Only in the sandbox.

In the trainer it shares a process with the simulator, so it can spoil its own training and nothing else; a result on a
board always comes from an evaluation in other processes.

Rules (deepracer-simapp, agent_ctrl/rollout_agent_ctrl.py): it gets a deep copy of the params; what it returns is cast
to float; NaN, infinity, more than 1e5 either way and every exception end the training.
"""

import builtins
import difflib
import functools
import inspect
import math
import sys
import unicodedata  # noqa: F401  the compiler asks for it at the first name beyond ASCII, and a locked process opens no file
from collections.abc import Callable, Sequence
from types import CodeType, FrameType, ModuleType, TracebackType
from typing import Any, TypedDict, cast

from paddock.errors import UserFault
from paddock.simulator.physics import PADDOCK_CAR

from .allowed_modules import importer
from .call_limits import FILENAME, Halted, TooLong, TooMuchPrinted, watch
from .simulated_clock import PRESENT, EpisodeClock

NAME = "reward_function"
MAX_REWARD = 1e5
PARAMS, POSITIONAL = "params", "positional"  # the two forms
SELF = "self"  # which may stand before the arguments of either, as in the printed examples of 2018
POSITIONAL_NAMES = (
    *("on_track", "x", "y", "distance_from_center", "car_orientation", "progress", "steps", "throttle", "steering"),
    *("track_width", "waypoints", "closest_waypoint"),
)
_TEXT = 300

Params = dict[str, Any]


class Self:
    """The ``self`` of a function in the form of 2018: keeps attributes; one for each car, empty at first."""


class Reward:
    """One loaded reward function, callable with params; what it keeps from step to step is its own.

    ``form``: ``"params"`` or ``"positional"``. ``line``: where it is defined. ``reward_function`` may be anything that
    can be called with params: a function, a method of an object, an object with ``__call__``.
    """

    def __init__(self, program: CodeType) -> None:
        """Runs the program's top level. Raises UserFault."""
        module = ModuleType(NAME)
        self._clock = EpisodeClock()
        PRESENT.now = 0.0
        own = {"__import__": importer(self._clock, builtins.__import__)}
        module.__dict__["__builtins__"] = vars(builtins) | own
        watch.begin()
        try:
            exec(program, module.__dict__)
            function = module.__dict__.get(NAME)
            self._code = _code_of(function)
            names, needed, by_name = _arguments_of(function)
        except Halted:
            raise
        except BaseException as error:
            raise _fault(error, sys.exc_info()[2], 1) from None
        finally:
            watch.end()
        _refuse_too_long(1)
        if not callable(function) or isinstance(function, type):
            raise UserFault("reward_function_missing")
        self.line = self._code.co_firstlineno if self._code is not None else 1
        if inspect.iscoroutinefunction(function) or inspect.isgeneratorfunction(function):
            raise UserFault("reward_function_kind", line=self.line)
        self.form = form_of(names, needed, by_name, self.line)
        self._self = (Self(),) if len(names) > 1 and names[0] == SELF and inspect.isfunction(function) else ()
        self._function: Callable[..., Any] = function
        self._module = module  # the function's globals live as long as it does

    def __call__(self, params: Params) -> float:
        """The reward, finite and within 1e5. Raises UserFault (codes ``reward_...``, with the ``line``)."""
        PRESENT.now = self._clock.now = float(params.get("sim_time", 0.0))
        watch.begin()
        try:
            value = self._reward(params)
        except (TooLong, TooMuchPrinted) as error:  # while a fault was being described
            raise _fault(error, sys.exc_info()[2], self.line) from None
        finally:
            watch.end()
        _refuse_too_long(self.line)
        return value

    def _reward(self, params: Params) -> float:
        try:
            value = float(_one_number(self._call(params)))
        except Halted:
            raise
        except BaseException as error:
            trace = sys.exc_info()[2]
            if not _lines(trace):  # the cast
                if isinstance(error, TypeError | ValueError):
                    raise UserFault("reward_not_a_number", line=self._return_line(params)) from None
                if isinstance(error, OverflowError):
                    raise UserFault("reward_too_large", line=self._return_line(params), value="1e308") from None
            raise _misspelt(error, trace, params) or _fault(error, trace, self.line) from None
        if not math.isfinite(value):
            raise UserFault("reward_not_finite", line=self._return_line(params), value=str(value))
        if abs(value) > MAX_REWARD:
            raise UserFault("reward_too_large", line=self._return_line(params), value=f"{value:g}")
        return value

    def _call(self, params: Params) -> Any:
        copy = self._copy(params)
        if self.form == PARAMS:
            return self._function(*self._self, copy)
        return self._function(*self._self, *positional(copy))

    def _copy(self, params: Params) -> Params:
        # A deep copy: all that can change in params are the dict and its flat lists (of numbers and pairs).
        return {key: list(value) if type(value) is list else value for key, value in params.items()}

    def _return_line(self, params: Params) -> int:
        """The line of the return that gave a bad value, found by tracing another call; else the definition's line."""
        line = self.line
        code = self._code

        def follow(frame: FrameType, event: str, _value: object) -> Any:
            nonlocal line
            if frame.f_code is not code:
                return None
            if event == "return":
                line = frame.f_lineno
            return follow

        before = sys.gettrace()
        sys.settrace(follow)
        try:
            self._call(params)
        except Exception:
            return self.line
        finally:
            sys.settrace(before)
        return line


def _refuse_too_long(line: int) -> None:
    """Raises UserFault for a call that returned after its time was up, which only a ``__del__`` can hide."""
    if watch.too_long_in is not None:
        raise UserFault("reward_too_slow", line=watch.too_long_in or line)


def compile_reward(code: str) -> CodeType:
    """The program of a reward function's text; nothing of it runs. Raises UserFault ``reward_syntax``."""
    try:
        return compile(without_mark(code), FILENAME, "exec", dont_inherit=True)
    except SyntaxError as error:
        raise UserFault("reward_syntax", line=error.lineno or 1, detail=printable(error.msg)) from None
    except (ValueError, RecursionError, MemoryError, OverflowError) as error:
        raise UserFault("reward_syntax", line=1, detail=printable(str(error) or type(error).__name__)) from None


def load_reward(code: str) -> Reward:
    return Reward(compile_reward(code))


def load_rewards(code: str, count: int) -> list[Reward]:
    """The function ``count`` times, each with its own globals: one for each car of a vectorised environment. Raises
    UserFault, and Halted when the training ends."""
    program = compile_reward(code)
    rewards = []
    try:
        for _ in range(count):
            if watch.must_halt():
                raise Halted
            rewards.append(Reward(program))
            watch.muted = True  # what its top level prints is printed once
    finally:
        watch.muted = False
    return rewards


def form_of(names: Sequence[str], needed: int, by_name: int, line: int) -> str:
    """The form by the names of the arguments, of which only a leading ``self`` counts. ``needed``: arguments without a
    default; ``by_name``: required keyword arguments beside them. Raises UserFault ``reward_arguments``."""
    before = len(names) > 1 and names[0] == SELF
    count, needed = len(names) - before, max(0, needed - before)
    if count >= 1 >= needed and not by_name:
        return PARAMS
    if count >= len(POSITIONAL_NAMES) >= needed and not by_name:
        return POSITIONAL
    raise UserFault("reward_arguments", line=line, count=len(names) + by_name)


def name_state(fault: UserFault, params: Params, state: str = "") -> None:
    """Add to a failure of a call the state of the car that it came in; ``state``: the name of a state of validation."""
    if fault.code == "reward_raised":
        named = f"steps {params.get('steps')}, progress {params.get('progress', 0.0):.1f}"
        fault.params["error"] = f"{fault.params['error']} ({state + ': ' if state else ''}{named})"


def without_mark(code: str) -> str:
    return code.removeprefix("\ufeff")


def _one_number(value: Any) -> Any:
    """The number of an array that holds one, whatever its shape; anything else as it is."""
    numpy = sys.modules.get("numpy")
    if numpy is not None and isinstance(value, numpy.ndarray) and value.size == 1:
        return value.item()
    return value


def _code_of(function: Any) -> CodeType | None:
    """The code that runs when it is called, where it is the racer's own."""
    while isinstance(function, functools.partial):
        function = function.func
    if callable(function) and not inspect.isroutine(function):
        function = type(function).__call__
    code = getattr(inspect.unwrap(getattr(function, "__func__", function)), "__code__", None)
    return code if isinstance(code, CodeType) and code.co_filename == FILENAME else None


def _arguments_of(function: Any) -> tuple[list[str], int, int]:
    """Names of the positional arguments, how many have no default, and the number of required keyword arguments.
    Without a signature: one."""
    try:
        arguments = inspect.signature(function).parameters.values()
    except (TypeError, ValueError):
        return ["params"], 1, 0
    placed = [one for one in arguments if one.kind in (one.POSITIONAL_ONLY, one.POSITIONAL_OR_KEYWORD)]
    by_name = [one for one in arguments if one.kind is one.KEYWORD_ONLY and one.default is one.empty]
    return [one.name for one in placed], sum(one.default is one.empty for one in placed), len(by_name)


def positional(params: Params) -> tuple[Any, ...]:
    """The separate values of the first form (2018), in the order of ``POSITIONAL_NAMES``, from today's params.

    ``on_track``: the nose is between the borders. ``x``, ``y`` and ``waypoints`` in metres and ``progress`` in percent,
    as that year's simulator passed them (its documentation specified shares of 1); ``car_orientation`` in radians;
    ``throttle`` from 0 to 1 (the greatest speed) and ``steering`` from -1 (right) to 1 (left), of the last command.
    """
    waypoints = params["waypoints"]
    here = params["x"], params["y"]
    return (
        params["distance_from_center"] <= params["track_width"] / 2,
        *here,
        params["distance_from_center"],
        math.radians(params["heading"]),
        params["progress"],
        params["steps"],
        params["speed"] / PADDOCK_CAR.max_speed,
        params["steering_angle"] / PADDOCK_CAR.max_steering_deg,
        params["track_width"],
        waypoints,
        min(params["closest_waypoints"], key=lambda index: math.dist(waypoints[index], here)),
    )


def printable(text: str) -> str:
    """Untrusted text as one short printable line."""
    text = text[:_TEXT]
    return "".join(letter if letter.isprintable() else " " for letter in text)


def readable(text: str) -> str:
    """Untrusted text as lines that are safe to show: without characters that move a cursor, hide or reverse letters."""
    return "".join(letter if letter.isprintable() or letter in "\n\t" else "?" for letter in text)


def fault_in(error: BaseException) -> UserFault | None:
    """The fault for an exception of our own code with the racer's lines in its traceback; None without such lines."""
    return _fault(error, error.__traceback__, 1) if _lines(error.__traceback__) else None


def _fault(error: BaseException, trace: TracebackType | None, otherwise: int) -> UserFault:
    """The fault for an exception from the racer's code; ``otherwise``: the line if none is known. The racer may have
    defined its class, so only its real type is read."""
    lines = _lines(trace)
    line = lines[-1] if lines else otherwise
    kind = type(error)
    if issubclass(kind, UserFault):
        return cast("UserFault", error)
    BaseException.with_traceback(error, None)  # its frames hold all that the function had in memory
    if issubclass(kind, TooLong):
        return UserFault("reward_too_slow", line=line)
    if issubclass(kind, TooMuchPrinted):
        return UserFault("reward_prints_too_much", line=line)
    if issubclass(kind, MemoryError):
        return UserFault("reward_memory", line=line)
    if issubclass(kind, ImportError):
        return UserFault("reward_import_failed", line=line, detail=_described(error))
    return UserFault("reward_raised", line=line, error=_described(error))


def _misspelt(error: BaseException, trace: TracebackType | None, params: Params) -> UserFault | None:
    """The fault for a misspelt key of params, with the most similar key; None if there is none."""
    if type(error) is not KeyError or len(error.args) != 1 or type(error.args[0]) is not str:
        return None
    name, lines = error.args[0], _lines(trace)
    meant = difflib.get_close_matches(name[:_TEXT], params, n=1)
    if not meant or name in params or not lines:
        return None
    return UserFault("reward_param_unknown", line=lines[-1], name=printable(name), meant=meant[0])


def _described(error: BaseException) -> str:
    name = text = ""
    try:
        name = printable(type(error).__name__)
        text = printable(str(error))
    except (TooLong, TooMuchPrinted, Halted):
        raise
    except BaseException:
        name = name or "an exception without a name"
    return f"{name}: {text}" if text else name


def _lines(trace: TracebackType | None) -> list[int]:
    lines = []
    while trace is not None:
        if trace.tb_frame.f_code.co_filename == FILENAME:
            lines.append(trace.tb_lineno)
        trace = trace.tb_next
    return lines


_PAIRS = ("waypoints", "objects_location")


class StatesOfDrive(TypedDict):
    """States on one track as plain JSON values. ``same``: what all of them have alike, such as the waypoints."""

    same: Params
    states: list[Params]


def to_wire(states: Sequence[Params]) -> StatesOfDrive:
    first = states[0] if states else {}
    same = {key: value for key, value in first.items() if all(state[key] == value for state in states)}
    return {
        "same": same,
        "states": [{key: value for key, value in state.items() if key not in same} for state in states],
    }


def from_wire(data: StatesOfDrive) -> list[Params]:
    same = _paired(data["same"])
    return [{**same, **_paired(state)} for state in data["states"]]


def _paired(values: Params) -> Params:
    """JSON has lists where params have tuples."""
    return {key: [tuple(place) for place in value] if key in _PAIRS else value for key, value in values.items()}
