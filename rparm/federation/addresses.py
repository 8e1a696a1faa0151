"""Addresses of federations, as tcp://192.168.0.1:23404: right, free, or listened at."""

import errno
import os
import re
import socket
import time
from collections.abc import Callable

from rparm.errors import UserError, reason

LOCAL = "127.0.0.1"
PAUSE = 0.2  # s, before the next attempt to connect


def check_host() -> None:
    """UserError where HELICS finds no address, not even 127.0.0.1: with no other one of IPv4."""
    try:
        # as HELICS asks: glibc does not count loopback
        flags = socket.AI_ADDRCONFIG
        socket.getaddrinfo(LOCAL, None, socket.AF_INET, socket.SOCK_STREAM, 0, flags)
    except socket.gaierror as error:
        raise UserError(
            f"HELICS needs an IPv4 address besides {LOCAL}: connect to a network, or, on "
            "Linux as root: ip address add 192.0.2.1/32 dev lo"
        ) from error


def free() -> str:
    """An address on this machine at which nothing listens; UserError if HELICS finds none."""
    check_host()
    with socket.socket() as probe:
        probe.bind((LOCAL, 0))
        return f"tcp://{LOCAL}:{probe.getsockname()[1]}"


def check_form(address: str) -> tuple[str, int]:
    """Host and port; UserError for others, and for IPv6: HELICS would listen and never return."""
    found = re.fullmatch(r"tcp://([\w.-]+):([1-9]\d{0,4})", address)
    if not found or int(found[2]) > 65535 or found[1] == "0.0.0.0":
        raise UserError(f"{address!r}: expected an address as tcp://192.168.0.1:23404")
    return found[1], int(found[2])


def check_free(address: str) -> None:
    """UserError if no broker can listen at `address`."""
    check_host()
    refusal = _refusal(*check_form(address))
    if refusal:
        raise UserError(f"nothing can listen at {address}: {refusal}")


def wait_for(address: str, seconds: float, say: Callable[[], object]) -> None:
    """Wait until something listens at `address`; `say` so, if it does not yet.

    HELICS would wait too, but print that it does, several times a second.

    UserError if nothing has listened there after `seconds`, or the host is unknown.
    """
    place = check_form(address)
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
        time.sleep(PAUSE)


def _refusal(host: str, port: int) -> str:
    """Why nothing can listen there; empty if it can."""
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
