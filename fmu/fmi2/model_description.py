"""Writes modelDescription.xml of FMI 2.0 (section 2.2 of the specification)."""

from collections.abc import Mapping, Sequence
from dataclasses import replace

from compiler.interface import Declaration, Variable
from description_parts import described, display_unit, type_names, values
from program import Provenance

TYPES = {"float64": "Real", "int32": "Integer", "enumeration": "Enumeration", "boolean": "Boolean"}


def model_description(
    declaration: Declaration, provenance: Provenance, sources: Sequence[str] = ()
) -> str:
    """Text of modelDescription.xml; `sources`: files in the FMU's sources/ that are compiled."""
    variables = with_aliases(declaration)
    index = {name: i for i, name in enumerate(variables, start=1)}

    def typed(variable: Variable, type_name: str | None) -> dict[str, object]:
        """Return the attributes of the element of the variable's type."""
        keys = {"declaredType": type_name or None}
        if variable.unit:
            keys |= {"unit": variable.unit, "displayUnit": display_unit(variable)}
        keys |= {"derivative": index.get(variable.derivative_of), **values(variable)}
        return {**keys, "nominal": variable.nominal}

    return described(
        "fmi2",
        declaration,
        provenance,
        sources=sources,
        variables=variables,
        types=type_names(variables),
        names=TYPES,
        shared=shared_keys,
        typed=typed,
        index=index,
        structure=structure(variables, index),
    )


def with_aliases(declaration: Declaration) -> dict[str, Variable]:
    """Return all variables, and after each state that is the derivative of another one its alias.

    Importers expect each state derivative among the initial unknowns, and no variable that has a
    start value, as states do. So the alias, der_STATE, is the derivative, with the state's value
    reference and no start value; marked themselves, states would be for a further state.
    """
    variables: dict[str, Variable] = {}
    for name, variable in declaration.variables.items():
        variables[name] = variable
        if variable.derivative_of is None or variable.initial != "exact":
            continue
        variables[name] = replace(variable, derivative_of=None)
        variables[f"der_{variable.derivative_of}"] = replace(
            variable,
            causality="local",
            initial="calculated",
            start=None,
            reinit=False,
            description=f"Time derivative of {variable.derivative_of}: alias of {name}",
        )
    return variables


def shared_keys(name: str, variable: Variable) -> dict[str, object]:
    """Return the attributes that variables of all types can have."""
    keys = ("description", "causality", "variability", "initial")
    given = {key: getattr(variable, key) or None for key in keys}
    return {"name": name, "valueReference": variable.reference, **given}


def structure(
    variables: Mapping[str, Variable], index: Mapping[str, int]
) -> dict[str, dict[int, list[int]]]:
    """Return exact dependencies (section 2.2.8 of the specification) by unknowns' indexes."""
    unknowns = {name: variable for name, variable in variables.items() if variable.is_unknown}
    calculated = {name: v for name, v in unknowns.items() if v.initial == "calculated"}
    outputs = {name: v for name, v in variables.items() if v.causality == "output"}
    derivatives = {name: v for name, v in calculated.items() if v.derivative_of}
    later = {"Outputs": outputs, "Derivatives": derivatives}
    knowns = {
        section: {name: v.dependencies or () for name, v in of_section.items()}
        for section, of_section in later.items()
    }
    knowns["InitialUnknowns"] = {n: v.initial_knowns for n, v in calculated.items()}
    return {
        section: {
            index[name]: sorted(index[known] for known in of_unknown)
            for name, of_unknown in of_section.items()
        }
        for section, of_section in knowns.items()
    }
