"""A small model for the tests of scenarios: what its FMU declares, and a place for scenarios."""

from collections.abc import Callable
from io import BytesIO
from pathlib import Path
from zipfile import ZipFile

from fmpy import read_model_description

from rparm.fmi.model import Model, described

DESCRIPTION = """<?xml version="1.0" encoding="UTF-8"?>
<fmiModelDescription fmiVersion="2.0" modelName="Toy" guid="{0}">
  <CoSimulation modelIdentifier="Toy"/>
  <TypeDefinitions>
    <SimpleType name="Gear"><Enumeration>
      <Item name="first" value="1"/><Item name="second" value="2"/><Item name="third" value="3"/>
    </Enumeration></SimpleType>
  </TypeDefinitions>
  <ModelVariables>
    <ScalarVariable name="time" valueReference="0" causality="independent"><Real/></ScalarVariable>
    <ScalarVariable name="mass" valueReference="1" causality="parameter" variability="tunable">
      <Real unit="kg" min="0.5" start="1.0"/></ScalarVariable>
    <ScalarVariable name="speed" valueReference="3" causality="output" initial="exact">
      <Real max="100.0" start="0.0"/></ScalarVariable>
    <ScalarVariable name="power" valueReference="4" causality="output"><Real/></ScalarVariable>
    <ScalarVariable name="force" valueReference="5" causality="input">
      <Real min="-10.0" start="2.5"/></ScalarVariable>
    <ScalarVariable name="gear" valueReference="6" causality="parameter" variability="fixed">
      <Enumeration declaredType="Gear" start="2" min="1" max="3"/></ScalarVariable>
    <ScalarVariable name="max_steps" valueReference="9" causality="parameter" variability="fixed">
      <Integer start="7"/></ScalarVariable>
    <ScalarVariable name="quiet" valueReference="10" causality="parameter" variability="fixed">
      <Boolean start="false"/></ScalarVariable>
  </ModelVariables>
  <ModelStructure/>
</fmiModelDescription>
"""
HEAD = 'title = "A"\ndescription = "B"\ntolerance = 1e-6\n'
TIME = "[time]\nstart = 1.0\nstop = 2.0\nstep = 0.25\n"


def toy(text: str = DESCRIPTION) -> Model:
    """The model that a model description declares."""
    archive = BytesIO()
    with ZipFile(archive, "w") as fmu:
        fmu.writestr("modelDescription.xml", text)
    return described(read_model_description(archive, validate=False))


TOY = toy()


def timed(start: object, stop: object, step: object) -> str:
    return f"{HEAD}[time]\nstart = {start}\nstop = {stop}\nstep = {step}\n"


def make_model(tmp_path: Path) -> Callable[..., Path]:
    """Make the model's folder; what is returned writes a scenario of it and returns its path."""
    folder = tmp_path / "models" / "toy" / "scenarios"
    folder.mkdir(parents=True)

    def write(text: str, name: str = "run") -> Path:
        path = folder / f"{name}.toml"
        path.write_text(text)
        return path

    return write
