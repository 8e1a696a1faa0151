"""The network of a federation: addresses, and the functions of HELICS with errors as the user's.

HELICS counts communication points: its time k is the k-th of them, whatever its time in s. So no
time is rounded to HELICS's own resolution, and every process calculates it from its own counter.
HELICS writes to standard error on its own when connections end.
"""

import errno
import os
import re
import secrets
import socket
import sys
import time
import warnings
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from contextlib import AbstractContextManager, contextmanager, suppress
from functools import partial
from threading import Thread
from typing import Any

import numpy as np

from rparm import project
from rparm.errors import UserError, one_line, reason

LOCAL = "127.0.0.1"
ATTEMPT_EVERY = 0.2  # s, before the next attempt to connect
ENDED = "the federation ended"  # in messages of processes that others have stopped
ABSENT = "no federation at"  # the same of one that comes later
ANSWER = 5.0  # s, for another process to answer
JOIN = 25.0  # s, for the broker to answer
JOINS = 5  # attempts, because a stranger who is refused may end one of them
TOO_EARLY = "already moved to operating state"  # message of HELICS then
PAUSE = 0.05  # s, before the same question
NOT_FOUND = 404  # HELICS's code of an answer
SYSTEM = "system"  # the system that all must step, a global value of the federation
KEY = "RPARM_FEDERATION_KEY"  # variable of the environment, which only its user can read
QUIET = "--loglevel=none"
# One port, the broker's: with "zmq" each process needs one, by its number, and "zmq_ss" drops
# messages when a process runs ahead.
NETWORK = "tcp_ss"
STDERR = 2  # file descriptor, to which libraries write
_is_separate = False


# ---- Addresses -----------------------------------------------------------------------------------
def check_host_has_address() -> None:
    """Refuse a machine where HELICS finds no address, not even 127.0.0.1, as no other IPv4 one."""
    try:
        # as HELICS asks: glibc does not count loopback
        flags = socket.AI_ADDRCONFIG
        socket.getaddrinfo(LOCAL, None, socket.AF_INET, socket.SOCK_STREAM, 0, flags)
    except socket.gaierror as error:
        raise UserError(
            f"HELICS needs an IPv4 address besides {LOCAL}: connect to a network, or, on "
            "Linux as root: ip address add 192.0.2.1/32 dev lo"
        ) from error


def free_address() -> str:
    """Find an address on this machine at which nothing listens; UserError if HELICS finds none."""
    check_host_has_address()
    with socket.socket() as probe:
        probe.bind((LOCAL, 0))
        return f"tcp://{LOCAL}:{probe.getsockname()[1]}"


def check_address(address: str) -> tuple[str, int]:
    """Return host and port; UserError for others, and for IPv6: HELICS would never return."""
    found = re.fullmatch(r"tcp://([\w.-]+):([1-9]\d{0,4})", address)
    if not found or int(found[2]) > 65535 or found[1] == "0.0.0.0":
        raise UserError(f"{address!r}: expected an address as tcp://192.168.0.1:23404")
    return found[1], int(found[2])


def check_address_is_free(address: str) -> None:
    """Refuse an address at which no broker can listen."""
    check_host_has_address()
    refusal = _refusal_to_listen(*check_address(address))
    if refusal:
        raise UserError(f"nothing can listen at {address}: {refusal}")


def wait_for_listener(address: str, seconds: float, say: Callable[[], object]) -> None:
    """Wait until something listens at `address`; `say` so, if it does not yet.

    HELICS would print that it waits, several times a second. UserError after `seconds`, or if the
    host is unknown.
    """
    place = check_address(address)
    latest = time.monotonic() + seconds
    is_said = False
    while True:
        try:
            socket.create_connection(place, timeout=1.0).close()
            return
        except socket.gaierror as error:
            raise UserError(f"{address}: {reason(error)}") from error
        except OSError as error:
            if time.monotonic() > latest:
                raise UserError(f"nothing has listened at {address} for {seconds:g} s") from error
        if not is_said:
            say()
            is_said = True
        time.sleep(ATTEMPT_EVERY)


def _refusal_to_listen(host: str, port: int) -> str:
    """Say why nothing can listen there; empty if it can."""
    try:
        with socket.socket() as probe:
            if os.name == "posix":  # as HELICS does: connections that have ended do not count
                probe.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
            probe.bind((host, port))
    except OSError as error:
        known = {
            errno.EADDRINUSE: f"port {port} is in use",
            errno.EADDRNOTAVAIL: f"{host} is no address of this machine",
        }
        return known.get(error.errno, f"{host}, port {port}: {reason(error)}")
    return ""


# ---- HELICS --------------------------------------------------------------------------------------
def helics() -> Any:
    """Import the package helics; UserError if it is not installed."""
    try:
        import helics as package
    except (ImportError, OSError) as error:
        raise UserError(
            f"helics, which only federations need, cannot be loaded: {one_line(error)} "
            f"({project.how_to_install('federation')} installs it)"
        ) from error
    warnings.filterwarnings("ignore", "This function will return a JSON", UserWarning)
    return package


def key() -> str:
    """Return the secret for joining, made if there is none; UserError if it is weak."""
    found = os.environ.setdefault(KEY, secrets.token_hex(16))
    if not re.fullmatch(r"[0-9A-Za-z]{16,128}", found):
        raise UserError(f"{KEY}: expected 16 to 128 letters and digits in the environment")
    return found


class Broker(AbstractContextManager["Broker"]):
    """Broker at `address`, to which all `count` processes of a federation connect."""

    def __init__(self, count: int, address: str) -> None:
        h = self._h = helics()
        self._questions = _Questions()
        self._address = address
        options = f"-f {count} --maxfederates={count} --brokerkey={key()} "
        options += f"--local_interface={address} {QUIET}"
        try:
            self._broker = h.helicsCreateBroker(NETWORK, "", options)
        except h.HelicsException as error:
            raise UserError(f"no broker at {address}: {one_line(error)}") from error
        if not h.helicsBrokerIsConnected(self._broker):
            self._close()
            raise UserError(f"no broker at {address}: nothing can listen there any more")

    def __exit__(self, *_: object) -> None:
        self._close()

    def _close(self) -> None:
        def close() -> None:
            self._h.helicsBrokerDisconnect(self._broker)
            if self._questions.ended():  # else they still use it
                self._h.helicsBrokerFree(self._broker)

        # nothing watches this one, and HELICS sets no limit to its waiting
        closing = Thread(target=close, daemon=True)
        closing.start()
        closing.join(2.0 * ANSWER)

    @contextmanager
    def shielded(self) -> Iterator[None]:
        """Keep a first process, the one that HELICS 3.6 ends in place of those that are refused."""
        h = self._h
        options = f"--federates=1 --brokerkey={key()} --broker_address={self._address} {QUIET}"
        try:
            first = h.helicsCreateCore(NETWORK, f"first-{secrets.token_hex(8)}", options)
            h.helicsCoreConnect(first)
        except h.HelicsException as error:
            raise UserError(f"no broker at {self._address}: {one_line(error)}") from error
        try:
            yield
        finally:
            h.helicsCoreDisconnect(first)

    def announce(self, system: str) -> None:
        """Publish the system that all must step."""
        self._h.helicsBrokerSetGlobal(self._broker, SYSTEM, system)

    def end(self, text: str) -> None:
        """End the federation for all, and say why."""
        self._h.helicsBrokerGlobalError(self._broker, 1, text.encode())  # takes no str

    def silent(self, names: Sequence[str], to_come: Collection[str]) -> list[str]:
        """Return processes that do not answer, or that HELICS forgot and are not `to_come`."""

        def ask(name: str) -> object:
            query = self._h.helicsCreateQuery(name, "current_time")
            return self._h.helicsQueryBrokerExecute(query, self._broker)

        answers = self._questions.answers(ask, names)
        unknown = {n for n, a in answers.items() if isinstance(a, dict) and "error" in a}
        silent = [n for n in names if n not in answers]
        return silent or [n for n in names if n in unknown and n not in to_come]


class _Questions:
    """Questions to other processes, in threads: HELICS may wait for an answer without end."""

    def __init__(self) -> None:
        self._threads: list[Thread] = []

    def answers(self, ask: Callable[[str], object], names: Sequence[str]) -> dict[str, object]:
        """Return the answers of `ask` that arrive in time, by name."""
        answers: dict[str, object] = {}

        def put(name: str) -> None:
            with suppress(helics().HelicsException):  # an error is no answer
                answers[name] = ask(name)

        self._threads = [Thread(target=put, args=(name,), daemon=True) for name in names]
        for thread in self._threads:
            thread.start()
        self.ended()
        return dict(answers)

    def ended(self) -> bool:
        """Wait for the answers, but not for long."""
        latest = time.monotonic() + ANSWER
        for thread in self._threads:
            thread.join(max(0.0, latest - time.monotonic()))
        return not any(thread.is_alive() for thread in self._threads)


class Federate:
    """Process that publishes a vector and reads the vectors of `sources`, with their exchanges."""

    def __init__(
        self, name: str, address: str, sources: Sequence[str], publishes: bool = True
    ) -> None:
        self._h = helics()
        self._name, self._address, self._sources = name, address, sources
        self._publishes = publishes
        self._federate: Any = None  # before it has joined
        self.exchanges = 0  # made so far
        self.all_here = False  # whether all others have joined
        self.waits = False  # for others
        self.calls = 0  # changes of `waits`

    @contextmanager
    def _waiting(self, text: str) -> Iterator[None]:
        self.waits, self.calls = True, self.calls + 1
        try:
            yield
        except self._h.HelicsException as error:
            said = re.sub(r"^\[-?\d+\] ", "", one_line(error))
            raise UserError(f"{text}: {said}") from error
        finally:
            self.waits, self.calls = False, self.calls + 1

    def join(self) -> None:
        h = self._h
        for left in reversed(range(JOINS)):
            try:
                with self._waiting(f"{ABSENT} {self._address}"):
                    self._federate = h.helicsCreateValueFederate(self._name, self._information())
                break
            except UserError as error:
                if TOO_EARLY not in str(error) or not left:
                    raise
        if self._publishes:
            kind = self._name, h.HELICS_DATA_TYPE_VECTOR, ""
            publish = h.helicsFederateRegisterGlobalPublication
            self._publication = publish(self._federate, *kind)
        subscribe = partial(h.helicsFederateRegisterSubscription, self._federate)
        self._subscriptions = {source: subscribe(source, "") for source in self._sources}

    def _information(self) -> Any:
        """Return the settings that HELICS needs to make the federate."""
        h = self._h
        info = h.helicsCreateFederateInfo()
        h.helicsFederateInfoSetCoreTypeFromString(info, NETWORK)
        # not one that another federate of this process has
        h.helicsFederateInfoSetCoreName(info, f"{self._name}-{secrets.token_hex(8)}")
        options = f"--federates=1 --broker_address={self._address} --network_timeout={JOIN:g}s"
        h.helicsFederateInfoSetCoreInitString(info, f"{options} {QUIET}")
        h.helicsFederateInfoSetBrokerKey(info, key())
        h.helicsFederateInfoSetTimeProperty(info, h.HELICS_PROPERTY_TIME_DELTA, 1.0)
        level = h.HELICS_PROPERTY_INT_LOG_LEVEL, h.HELICS_LOG_LEVEL_NO_PRINT
        h.helicsFederateInfoSetIntegerProperty(info, *level)
        return info

    def system(self) -> str:
        """Return the system that all must step, once the broker has announced it."""
        with self._waiting(f"at the start {ENDED}"):
            while True:
                answer = self._ask("global_value", SYSTEM)
                if isinstance(answer, str) and not answer.startswith("#"):  # as #disconnected
                    return answer
                if isinstance(answer, str) or answer["error"]["code"] != NOT_FOUND:
                    raise UserError(f"at the start {ENDED}")
                time.sleep(PAUSE)

    def has_broker(self) -> bool:
        ask = partial(self._ask, about="federates")
        return self._federate is None or bool(_Questions().answers(ask, ["root"]))

    def _ask(self, target: str, about: str) -> Any:
        query = self._h.helicsCreateQuery(target, about)
        return self._h.helicsQueryExecute(query, self._federate)

    def publish(self, values: np.ndarray) -> None:
        """Publish the values that others read after the next exchange, (values,)."""
        vector = [float(self.exchanges), *values.tolist()]
        with self._waiting(f"after exchange {self.exchanges} {ENDED}"):
            self._h.helicsPublicationPublishVector(self._publication, vector)

    def read(self) -> Mapping[str, Sequence[float]]:
        """Read all values that sources published before the last exchange, or raise UserError."""
        values = {}
        for source, place in self._subscriptions.items():
            count, *values[source] = self._h.helicsInputGetVector(place)
            if count != self.exchanges - 1:
                raise UserError(
                    f"after exchange {self.exchanges} {ENDED}: HELICS has not passed on to "
                    f"{self._name} what {source} published"
                )
        return values

    def enter_initialization(self) -> None:
        """Wait for all others; what is published before is read after the first `exchange`."""
        with self._waiting(f"at the start {ENDED}"):
            self._h.helicsFederateEnterInitializingMode(self._federate)
        self.all_here = True

    def exchange(self) -> None:
        """Give and take values in initialization."""
        h = self._h
        with self._waiting(f"in initialization {ENDED}"):
            result = h.helicsFederateEnterExecutingModeIterative(
                self._federate, h.HELICS_ITERATION_REQUEST_FORCE_ITERATION
            )
        if result != h.HELICS_ITERATION_RESULT_ITERATING:
            raise UserError(f"in initialization {ENDED}")
        self.exchanges += 1

    def begin(self) -> None:
        """Go to the first communication point."""
        with self._waiting(f"in initialization {ENDED}"):
            self._h.helicsFederateEnterExecutingMode(self._federate)
        self.exchanges += 1

    def go_to(self, point: int) -> None:
        """Wait until all others have published the values of communication point `point`."""
        with self._waiting(f"before communication point {point} {ENDED}"):
            granted = self._h.helicsFederateRequestTime(self._federate, float(point))
        if granted != point:
            raise UserError(f"before communication point {point} {ENDED}")
        self.exchanges += 1

    def leave(self) -> None:
        self._h.helicsFederateDisconnect(self._federate)

    def fail(self, text: str) -> None:
        """End the federation, because this process has failed."""
        if self._federate is not None:
            with suppress(self._h.HelicsException):  # it has ended already
                self._h.helicsFederateGlobalError(self._federate, 1, text)


# ---- Standard error ------------------------------------------------------------------------------
def separate_messages() -> None:
    """Give Python its own standard error from now on: to be called as the program starts."""
    global _is_separate
    with suppress(OSError, ValueError, AttributeError):  # closed, or not of the system
        stream = sys.stderr
        if not _is_separate and stream.fileno() == STDERR:
            stream.flush()
            own = os.dup(STDERR)
            sys.stderr = os.fdopen(own, "w", 1, stream.encoding, stream.errors)
            _is_separate = True


def mute_libraries() -> None:
    """Discard what libraries write from now on, if Python's messages are separate."""
    if _is_separate:
        with suppress(OSError):
            nowhere = os.open(os.devnull, os.O_WRONLY)
            os.dup2(nowhere, STDERR)
            os.close(nowhere)
