"""A federate of HELICS that does not belong to the federation: `... PORT USER NAME [OPTION...]`.

It becomes the user, unless that is -1, tries to join under a name that the federation may wait for,
and says whether it could.
"""

import os
import sys

import helics

port, user, name, *options = sys.argv[1:]
info = helics.helicsCreateFederateInfo()
helics.helicsFederateInfoSetCoreTypeFromString(info, "tcp_ss")
place = f"--broker_address=tcp://127.0.0.1:{port} --timeout=5s --loglevel=none"
helics.helicsFederateInfoSetCoreInitString(info, " ".join(["--federates=1", place, *options]))
if int(user) >= 0:
    os.setgroups([])
    os.setgid(int(user))
    os.setuid(int(user))
try:
    helics.helicsCreateValueFederate(name, info)
    print("joined", flush=True)
except helics.HelicsException as error:
    print(f"refused: {error}", flush=True)
os._exit(0)  # HELICS itself may wait
