"""The functions of HELICS that a federation calls, with errors as the user's.

HELICS counts communication points: its time k is the k-th of them, whatever its time in s. So no
time is rounded to HELICS's own resolution, and every process calculates it from its own counter.
"""

from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from typing import Any

import numpy as np

from cosim.errors import UserError, one_line

LOCAL = "tcp://127.0.0.1"


def helics() -> Any:
    """The package helics; UserError if it is not installed."""
    try:
        import helics as package
    except (ImportError, OSError) as error:
        raise UserError(
            f"helics, which only federations need, cannot be loaded: {one_line(error)} "
            "(./setup.sh --federation installs it)"
        ) from error
    return package


@contextmanager
def broker(count: int, address: str) -> Iterator[Callable[[str], None]]:
    """The broker of a federation of `count` processes, listening at `address`; gone at the end.

    Gives a function that ends the federation for all, and says why.
    """
    h = helics()
    options = f"-f {count} --local_interface={address} --loglevel=none"
    try:
        made = h.helicsCreateBroker("zmq", "", options)
    except h.HelicsException as error:
        raise UserError(f"no broker at {address}: {one_line(error)}") from error
    try:
        if not h.helicsBrokerIsConnected(made):
            raise UserError(f"no broker at {address}: nothing can listen there")
        yield lambda text: h.helicsBrokerGlobalError(made, 1, text.encode())  # takes no str
    finally:
        h.helicsBrokerDisconnect(made)
        h.helicsBrokerFree(made)


class Federate:
    """A process in a federation: publishes one vector, and reads those of others.

    Parameters
    ----------
    name : str
        Also of what it publishes.
    address : str
        Of the broker.
    sources : sequence of str
        Names of federates whose values it reads.
    publishes : bool
    """

    def __init__(
        self, name: str, address: str, sources: Sequence[str], publishes: bool = True
    ) -> None:
        h = self._h = helics()
        info = h.helicsCreateFederateInfo()
        h.helicsFederateInfoSetCoreTypeFromString(info, "zmq")
        h.helicsFederateInfoSetCoreInitString(
            info, f"--federates=1 --broker_address={address} --loglevel=none"
        )
        h.helicsFederateInfoSetTimeProperty(info, h.HELICS_PROPERTY_TIME_DELTA, 1.0)
        with self._explained(f"no federation at {address}"):
            self._federate = h.helicsCreateValueFederate(name, info)
        vector = h.HELICS_DATA_TYPE_VECTOR
        if publishes:
            self._publication = h.helicsFederateRegisterGlobalPublication(
                self._federate, name, vector, ""
            )
        self._subscriptions = {
            source: h.helicsFederateRegisterSubscription(self._federate, source, "")
            for source in sources
        }

    @contextmanager
    def _explained(self, text: str) -> Iterator[None]:
        try:
            yield
        except self._h.HelicsException as error:
            raise UserError(f"{text}: {one_line(error)}") from error

    def publish(self, values: np.ndarray) -> None:
        """Publish the values of the next communication point, (values,)."""
        self._h.helicsPublicationPublishVector(self._publication, values.tolist())

    def read(self) -> Mapping[str, Sequence[float]]:
        """The values of the present communication point, by source."""
        get = self._h.helicsInputGetVector
        return {source: get(place) for source, place in self._subscriptions.items()}

    def enter_initialization(self) -> None:
        """Wait for all others; what is published before is read after the first `exchange`."""
        with self._explained("the federation does not start"):
            self._h.helicsFederateEnterInitializingMode(self._federate)

    def exchange(self) -> None:
        """Give and take values in initialization."""
        with self._explained("in initialization the federation ended"):
            self._h.helicsFederateEnterExecutingModeIterative(
                self._federate, self._h.HELICS_ITERATION_REQUEST_FORCE_ITERATION
            )

    def begin(self) -> None:
        """To the first communication point."""
        with self._explained("in initialization the federation ended"):
            self._h.helicsFederateEnterExecutingMode(self._federate)

    def go_to(self, point: int) -> None:
        """Wait until all others have published the values of communication point `point`."""
        with self._explained(f"before communication point {point} the federation ended"):
            granted = self._h.helicsFederateRequestTime(self._federate, float(point))
        if granted != point:
            raise UserError(f"before communication point {point} the federation ended")

    def leave(self) -> None:
        """Leave at the end."""
        self._h.helicsFederateDisconnect(self._federate)

    def fail(self, text: str) -> None:
        """End the federation, because this process cannot go on."""
        self._h.helicsFederateGlobalError(self._federate, 1, text)
