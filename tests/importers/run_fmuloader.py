"""fmuloader: thin bindings of the functions of FMI 2.0 and 3.0; inputs set before each step."""

import xml.etree.ElementTree as ET
import zipfile

from fmuloader.fmi2 import Fmi2Slave, Fmi2Type
from fmuloader.fmi3 import Fmi3Slave
from plan import Plan, Rows, main


def read_description(fmu: str) -> ET.Element:
    with zipfile.ZipFile(fmu) as archive:
        return ET.fromstring(archive.read("modelDescription.xml"))


def run(plan: Plan) -> Rows:
    description = read_description(plan.fmu)
    references = {
        v.get("name"): int(v.get("valueReference")) for v in description.find("ModelVariables")
    }
    identifier = description.find("CoSimulation").get("modelIdentifier")
    outputs = [references[name] for name in plan.outputs]
    if description.get("fmiVersion") == "2.0":
        arm = Fmi2Slave(plan.fmu, model_identifier=identifier)
        arm.instantiate("arm", Fmi2Type.CO_SIMULATION, guid=description.get("guid"))
        set_values, get_values = arm.set_real, arm.get_real
        arm.setup_experiment(plan.start)
        initialization = ()
    else:
        arm = Fmi3Slave(plan.fmu, model_identifier=identifier)
        token = description.get("instantiationToken")
        arm.instantiate_co_simulation("arm", instantiation_token=token)
        set_values, get_values = arm.set_float64, arm.get_float64
        initialization = (plan.start,)

    def assign(values: dict[str, float]) -> None:
        set_values([references[name] for name in values], list(values.values()))

    with arm:
        assign(plan.start_values())
        arm.enter_initialization_mode(*initialization)
        arm.exit_initialization_mode()
        rows = [get_values(outputs)]
        for i in range(plan.steps):
            assign(plan.inputs_at(i))
            arm.do_step(plan.time(i), plan.step)
            rows.append(get_values(outputs))
        arm.terminate()
    return rows


if __name__ == "__main__":
    main(run)
