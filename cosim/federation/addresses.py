"""Addresses of federations, as tcp://192.168.0.1:23404: of the right form, free to listen at."""

import errno
import os
import re
import socket

from cosim.errors import UserError, reason

LOCAL = "127.0.0.1"


def free() -> str:
    """An address on this machine at which nothing listens."""
    with socket.socket() as probe:
        probe.bind((LOCAL, 0))
        return f"tcp://{LOCAL}:{probe.getsockname()[1]}"


def check_form(address: str) -> tuple[str, int]:
    """Host and port; UserError if `address` is none."""
    found = re.fullmatch(r"tcp://([^/\s]+):([1-9]\d{0,4})", address)
    if not found or int(found[2]) > 65535:
        raise UserError(f"{address}: expected an address as tcp://192.168.0.1:23404")
    return found[1], int(found[2])


def check_free(address: str) -> None:
    """UserError if no broker can listen at `address`."""
    refusal = _refusal(*check_form(address))
    if refusal:
        raise UserError(f"nothing can listen at {address}: {refusal}")


def _refusal(host: str, port: int) -> str:
    """Why nothing can listen there; empty if it can."""
    try:
        family, *_, place = socket.getaddrinfo(
            None if host == "*" else host.strip("[]"),
            port,
            type=socket.SOCK_STREAM,
            flags=socket.AI_PASSIVE,
        )[0]
        with socket.socket(family) as probe:
            if os.name == "posix":  # as HELICS does: connections that have ended do not count
                probe.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
            probe.bind(place)
    except OSError as error:
        known = {
            errno.EADDRINUSE: f"port {port} is in use",
            errno.EADDRNOTAVAIL: f"{host} is no address of this machine",
        }
        return known.get(error.errno, f"{host}, port {port}: {reason(error)}")
    return ""
