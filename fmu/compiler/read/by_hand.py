"""Files of variables that C by hand calculates: of a struct model, and of each instance.

They have the keys of other files but for equations: `follows` of an output, a derivative or an
indicator lists the parameters, inputs and states that it follows from, and the time. `indicators`
names entries of [where] in the order of the model; `time_events = true` if it has these.
"""

from dataclasses import replace
from pathlib import Path

from ..expressions.expression import Node
from ..expressions.hints import meant
from ..graph.graph import Graph
from ..names import OwnFields
from .content import CALCULATED, Expression, ModelFile, ModelFileError, placed, shown
from .file import INSTANCE, located, read_tables, solver_names
from .include import source_of
from .model_file import leaves


def read(path: Path) -> ModelFile:
    """Read and check the file of a model; ModelFileError."""
    with placed(path):
        source = source_of(path)
    with located(path, source.text):
        file = read_tables(source, solver_names(), is_by_hand=True)
        file.sources = [each.path for each in source.all()]
        _calculate(file)
        _check_derivatives(file)
        _check_indicators(file)
    return file


def of_instance(name: str) -> ModelFile:
    """Read NAME_variables.toml of src/instance."""
    source = source_of(INSTANCE / f"{name}_variables.toml")
    file = read_tables(replace(source, tables={"name": name} | source.tables), (), is_by_hand=True)
    _calculate(file)
    return file


def _calculate(file: ModelFile) -> None:
    """Give variables values that follow from what their entries say."""
    file.graph, file.fields = Graph(), OwnFields()
    known = leaves(file, file.graph)
    for variable in file.of("states", *CALCULATED):
        place = (variable.place, variable.name, "follows")
        for name in variable.follows:
            if name not in known:
                with placed(*place):
                    what = f"expected parameters, inputs, states or time, got {shown(name)}"
                    raise ModelFileError(what + meant(name, known))
        variable.expression = Expression(place, "", Node("number", 0))
        given = [known[name] for name in variable.follows]
        variable.expression.value = file.graph.value("follows", *given)


def _check_derivatives(file: ModelFile) -> None:
    """Check that each state has one derivative."""
    found = [v.derivative_of for v in file.variables.values() if v.derivative_of]
    for state in file.of("states"):
        if found.count(state.name) != 1:
            with placed(state.place, state.name):
                raise ModelFileError(f'expected one variable with derivative_of = "{state.name}"')
    for variable in file.variables.values():
        name = variable.derivative_of
        if name and (name not in file.variables or file.variables[name].section != "states"):
            with placed(variable.place, variable.name, "derivative_of"):
                raise ModelFileError(f"expected a state, got {shown(name)}")


def _check_indicators(file: ModelFile) -> None:
    """Check that event indicators are local numbers that move, each once."""
    for i, name in enumerate(file.indicators):
        variable = file.variables.get(name)
        is_local = variable is not None and variable.section == "where" and variable.is_real
        if not is_local or variable.variability or name in file.indicators[:i]:
            with placed("indicators"):
                wanted = "expected continuous real numbers of [where], each once"
                raise ModelFileError(f"{wanted}, got {shown(name)}")
