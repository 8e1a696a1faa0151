"""What federates of HELICS give each other at an exchange."""

import socket
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import ExitStack, contextmanager, suppress

import numpy as np
import pytest

from rparm.errors import UserError
from rparm.federation import network
from rparm.federation.network import Broker, Federate

LIMIT = 120.0  # s


@pytest.fixture
def pool() -> Iterator[ThreadPoolExecutor]:
    with ThreadPoolExecutor(2) as made:
        yield made


def at_once(pool: ThreadPoolExecutor, *calls) -> None:
    for call in [pool.submit(call) for call in calls]:
        call.result(timeout=LIMIT)


@contextmanager
def begun(pool: ThreadPoolExecutor, address: str = "") -> Iterator[tuple[Federate, Federate]]:
    """Two federates at their first exchange, which leave at the end."""
    address = address or network.free_address()
    with Broker(2, address):
        one, two = Federate("one", address, ["two"]), Federate("two", address, ["one"])
        one.join()
        two.join()
        at_once(pool, one.enter_initialization, two.enter_initialization)
        one.publish(np.array([0.5]))
        at_once(pool, one.begin, two.begin)
        yield one, two
        at_once(pool, one.leave, two.leave)


def test_a_vector_is_read_after_the_next_exchange(pool: ThreadPoolExecutor) -> None:
    with begun(pool) as (one, two):
        assert two.read() == {"one": [0.5]}
        one.publish(np.array([0.1, -0.2]))
        assert two.read() == {"one": [0.5]}
        at_once(pool, lambda: one.go_to(1), lambda: two.go_to(1))
        assert two.read() == {"one": [0.1, -0.2]}


def test_values_of_another_exchange_are_no_values(pool: ThreadPoolExecutor) -> None:
    """`one` publishes nothing before the exchange, which looks like a message that is late."""
    with begun(pool) as (one, two):
        at_once(pool, lambda: one.go_to(1), lambda: two.go_to(1))
        words = "after exchange 2 the federation ended: HELICS has not passed on to two what one"
        with pytest.raises(UserError, match=words):
            two.read()
        with pytest.raises(UserError, match="what two published"):  # never anything
            one.read()


def test_one_port_is_enough(pool: ThreadPoolExecutor) -> None:
    address = network.free_address()
    _, port = network.check_address(address)
    with ExitStack() as stack:
        for other in range(port + 1, port + 20):
            with suppress(OSError, OverflowError):  # in use already, or no port
                stack.enter_context(socket.create_server(("", other)))
        stack.enter_context(begun(pool, address))


def test_what_is_stepped_is_waited_for(pool: ThreadPoolExecutor) -> None:
    """Or one could refuse it, and end the federation, before those have joined who must hear it."""
    address = network.free_address()
    with Broker(1, address) as broker:
        one = Federate("one", address, [])
        one.join()
        asked = pool.submit(one.system)
        with pytest.raises(TimeoutError):
            asked.result(timeout=0.5)
        broker.announce("variant hash")
        assert asked.result(timeout=LIMIT) == "variant hash"
        one.begin()
        one.leave()


def test_who_is_unknown_may_be_to_come() -> None:
    address = network.free_address()
    with Broker(2, address) as broker:
        one = Federate("one", address, [])
        one.join()
        assert broker.silent(["one", "two"], to_come=["two"]) == []
        assert broker.silent(["one", "two"], to_come=[]) == ["two"]


def test_a_federation_that_ended_steps_nothing() -> None:
    address = network.free_address()
    with Broker(1, address):
        one = Federate("one", address, [])
        one.join()
        one.fail("for a test")
        with pytest.raises(UserError, match="at the start the federation ended"):
            one.system()


def test_nothing_is_published_in_a_federation_that_ended(pool: ThreadPoolExecutor) -> None:
    """HELICS lets some begin that have heard of the end; they hear again by their next value."""
    address = network.free_address()
    with Broker(2, address):
        one, two = Federate("one", address, []), Federate("two", address, [])
        one.join()
        two.join()
        at_once(pool, one.enter_initialization, two.enter_initialization)
        two.fail("for a test")
        with pytest.raises(UserError, match="in initialization the federation ended"):
            while True:  # the first may still pass
                one.exchange()
        with pytest.raises(UserError, match=r"after exchange \d+ the federation ended: pub"):
            one.publish(np.array([0.5]))
