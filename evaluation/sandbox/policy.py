"""The launcher's side of one model in its policy process: start it, load the model, explain its end."""

from __future__ import annotations

import contextlib
import signal
import time
from collections.abc import Iterator
from typing import TYPE_CHECKING, Any

from paddock.errors import PaddockError, PlatformFault, UserFault
from paddock.network.policy_wire import PolicyHeader

from .frames import FrameClosed, FrameError, FrameTimeout, read_message, write_message
from .launch import launch
from .limits import POLICY, Limits
from .lock import EXIT_MEMORY
from .network_memory import create_network_memory
from .observation_memory import create_observation_memory, map_for_writing
from .policy_client import OVERAGE_S, STEP_DEADLINE_S, TOTAL_S, PolicyClient
from .process import SandboxedProcess, widen_pipe

if TYPE_CHECKING:
    from paddock.network.bound import FactsDocument

MODULE = "evaluation.sandbox.policy_process"
START_S = 30.0
LOAD_S = 20.0
_MAX_ANSWER = 4096


class PolicyProcess:
    """A context manager round the sandboxed process; leaving kills it. Raises PlatformFault where it cannot start."""

    def __init__(
        self, *, limits: Limits = POLICY, level: int | None = None, module: str = MODULE, **options: Any
    ) -> None:
        """``module``: another one has pipes alone. Raises what :func:`.launch.launch` raises; the memory goes then."""
        own = module == MODULE
        self._observation_memory, self._network_memory = (
            (create_observation_memory(), create_network_memory()) if own else (None, None)
        )
        with contextlib.ExitStack() as undone:
            undone.callback(self._forget)
            if own:
                fds = [
                    -1 if memory is None else memory.reading_fd
                    for memory in (self._observation_memory, self._network_memory)
                ]
                options |= {"arguments": [str(fd) for fd in fds], "pass_fds": [fd for fd in fds if fd >= 0]}
            self.process: SandboxedProcess = launch(module, limits=limits, level=level, **options)
            undone.pop_all()
        for memory in (self._observation_memory, self._network_memory):
            if memory is not None:
                memory.close_reading_end()
        self._cpu_from = 0.0
        widen_pipe(self.process.stdin)

    @property
    def memory_fd(self) -> int:
        """Where the referee shows what the car sees, see :mod:`.observation_memory`; -1 for nowhere."""
        return -1 if self._observation_memory is None else self._observation_memory.fd

    def get_ready(self) -> None:
        if self._network_memory is not None:
            self._network_memory.get_ready()

    def _forget(self) -> None:
        for memory in (self._observation_memory, self._network_memory):
            if memory is not None:
                memory.close()

    def __enter__(self) -> PolicyProcess:
        return self

    def __exit__(self, *_exc: object) -> None:
        self.process.close()
        self._forget()

    def load(self, onnx: bytes, header: PolicyHeader, facts: FactsDocument | None = None) -> str:
        """:meth:`give` and :meth:`agree` in one, for a referee in this process."""
        self.give(onnx, facts)
        return self.agree(header)

    def give(self, onnx: bytes, facts: FactsDocument | None = None) -> None:
        """Wait for the lock, then hand over the canonical ONNX bytes and their ``facts``
        (:class:`paddock.network.bound.NetworkFacts`; None: they are measured now). Raises UserFault (``policy_died``,
        ``policy_late``), and PlatformFault ``sandbox_failed`` if the process did not reach its lock."""
        self._wait_for_lock()
        message: dict[str, object] = {"facts": facts}
        blobs = [onnx]
        if self._network_memory is not None and self._network_memory.put(onnx):
            message["size"], blobs = len(onnx), []
        with self._blaming_the_policy():
            write_message(self.process.stdin, message, blobs, time.monotonic() + LOAD_S)
        if self._network_memory is not None:
            self._network_memory.close()  # from here on it is the process's alone

    def agree(self, header: PolicyHeader) -> str:
        """Send the header (:mod:`paddock.network.policy_wire`) and wait until the network is loaded. Returns the
        version of onnxruntime. Raises UserFault (``policy_refused``, ``policy_memory``, ``policy_died``,
        ``policy_late``, ``policy_protocol``)."""
        deadline = time.monotonic() + LOAD_S
        with self._blaming_the_policy():
            with contextlib.suppress(FrameClosed):  # one that does not load is refused, maybe before the header came
                write_message(self.process.stdin, header, deadline=deadline)
            answer, _ = read_message(self.process.stdout, deadline, json_limit=_MAX_ANSWER, blob_limit=0)
        state, version = answer.get("state"), _plain(answer.get("version"), 20)
        if state == "memory":
            raise self._memory()
        if state == "refused":
            raise UserFault("policy_refused", detail=_plain(answer.get("detail"), 200).rstrip(". "), version=version)
        if state != "ready":
            raise UserFault("policy_protocol", step=0)
        self._cpu_from = self.process.cpu_seconds()
        return version

    def client(self, header: PolicyHeader, **budget: float) -> PolicyClient:
        """A client on this process's pipes, for a referee in this process (the smoke run of an upload)."""
        memory = map_for_writing(self.memory_fd)
        return PolicyClient(self.process.stdout, self.process.stdin, header, memory=memory, **budget)

    def explain(self, fault: PaddockError) -> PaddockError:
        """The better fault for a policy that died or was late: the referee sees closed pipes or no answer.

        PlatformFault ``host_overloaded`` for one that hardly got the processor, or got SIGKILL: it can signal nobody,
        so the kernel sent it when the host's memory ran out.
        """
        late = fault.code in ("policy_late", "policy_late_exact")
        if late and self._starved(float(fault.params.get("waited_s", 0.0))):
            return PlatformFault("host_overloaded")
        if fault.code != "policy_died":
            return fault
        status = self.process.wait(1.0)
        if status == EXIT_MEMORY:
            return self._memory()
        if status == -signal.SIGKILL:
            return PlatformFault("host_overloaded")
        if status == -signal.SIGXCPU:
            return self._late(fault.params.get("step", 0), self.process.limits.cpu_s)
        return UserFault("policy_died", step=fault.params.get("step", 0), how=describe(status))

    @contextlib.contextmanager
    def _blaming_the_policy(self) -> Iterator[None]:
        """Past its lock the process has a stranger's bytes: errors of its pipes are the network's fault."""
        try:
            yield
        except FrameTimeout:
            raise self.explain(self._late(0, LOAD_S)) from None
        except FrameClosed:
            raise self.explain(UserFault("policy_died", step=0, how="")) from None
        except FrameError:
            raise UserFault("policy_protocol", step=0) from None

    def _starved(self, waited_s: float) -> bool:
        """Whether it computed for less than a fifth of the time waited for it, and would compute now."""
        computed_s = self.process.cpu_seconds() - self._cpu_from
        return self.process.wants_processor() and computed_s < waited_s / 5

    def _wait_for_lock(self) -> None:
        try:
            self.process.wait_for_lock(START_S)
        except FrameError as error:
            raise failed_start(self.process, str(error)) from None
        self._cpu_from = self.process.cpu_seconds()

    def _late(self, step: Any, waited_s: float) -> UserFault:
        budget = {"step_s": STEP_DEADLINE_S, "overage_s": OVERAGE_S, "total_s": TOTAL_S}
        return UserFault("policy_late", step=step, waited_s=waited_s, **budget)

    def _memory(self) -> UserFault:
        return UserFault("policy_memory", limit_mb=self.process.limits.address_space_mb)


def _plain(text: object, limit: int) -> str:
    """A stranger's text without NUL bytes, halves of characters and control characters."""
    return "".join(letter if letter.isprintable() else "?" for letter in str(text)[:limit])


def describe(status: int | None) -> str:
    """An exit status of :meth:`SandboxedProcess.wait` in words."""
    if status is None:
        return "closed its pipes and ran on"
    if status >= 0:
        return f"exit status {status}"
    try:
        return signal.Signals(-status).name
    except ValueError:
        return f"signal {-status}"


def failed_start(process: SandboxedProcess, problem: str) -> PlatformFault:
    """The fault for a process that did not start, with its stderr as a note for operators."""
    status = process.wait(0.5)
    fault = PlatformFault("sandbox_failed", detail=f"{problem}; {describe(status)}")
    fault.add_note(process.stderr_text())
    return fault
