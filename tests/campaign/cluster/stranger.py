"""One who knows the addresses of Dask's processes: `python -m tests.campaign.cluster.stranger`.

Reads places (host:port), a user id and credentials from standard input, becomes that user, and
says which attempts each of the processes has answered.
"""

import asyncio
import json
import os
import ssl
import sys

from distributed import Security
from distributed.core import rpc

REFUSAL = 5  # s; Dask tries again and again
ANSWER = 120  # s


def careless(security: Security | None) -> dict[str, object]:
    """Arguments of a connection that accepts any certificate, and shows its own or none."""
    if security is None:
        context = ssl.SSLContext(ssl.PROTOCOL_TLS_CLIENT)
        context.check_hostname = False
    else:
        context = security.get_connection_args("client")["ssl_context"]
    context.verify_mode = ssl.CERT_NONE
    return {"ssl_context": context, "require_encryption": True}


def attempts(cert: str, key: str) -> dict[str, tuple[str, dict[str, object], float]]:
    """Protocol, arguments and patience of each attempt to connect."""
    right = Security(
        require_encryption=True, tls_ca_file=cert, tls_client_cert=cert, tls_client_key=key
    )
    return {
        "plain": ("tcp", {}, REFUSAL),
        "without certificate": ("tls", careless(None), REFUSAL),
        "own certificate": ("tls", careless(Security.temporary()), REFUSAL),
        "right certificate": ("tls", right.get_connection_args("client"), ANSWER),
    }


async def answers(address: str, arguments: dict[str, object], patience: float) -> bool:
    """Whether a process says who it is."""

    async def ask() -> bool:
        async with rpc(address, connection_args=arguments, timeout=patience) as process:
            return "type" in await process.identity()

    try:
        return await asyncio.wait_for(ask(), patience)
    except (OSError, TimeoutError, ValueError, RuntimeError):
        return False


async def main() -> None:
    """Make all attempts, and write what came of them."""
    given = json.load(sys.stdin)
    made = attempts(given["cert"], given["key"])
    if given["user"] is not None:
        os.setgroups([])
        os.setgid(given["user"])
        os.setuid(given["user"])
    found = {}
    for place in given["places"]:
        asked = (answers(f"{scheme}://{place}", *how) for scheme, *how in made.values())
        found[place] = dict(zip(made, await asyncio.gather(*asked), strict=True))
    print(json.dumps({"user": os.getuid(), "answers": found}))


if __name__ == "__main__":
    asyncio.run(main())
