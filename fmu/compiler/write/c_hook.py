"""What the C of a model has of its hook: C by hand decides events, and sets modes.

It uses the structure of values of NAME_values.h; its struct model is NAME_model.
"""

from collections.abc import Mapping

from ..names import Field
from ..read.content import ModelFile

STRUCTURE, SYMBOL = "struct equations_values", "equations_model"  # without a hook


def structure(file: ModelFile) -> str:
    """Return the type of the value structure."""
    return f"struct {file.path.stem}_values" if file.hook else STRUCTURE


def symbol(file: ModelFile) -> str:
    """Return the name of the struct model."""
    return f"{file.path.stem}_model" if file.hook else SYMBOL


def events(file: ModelFile) -> str:
    """Return the name of the struct model_events."""
    return f"{file.path.stem}_events" if file.hook else "events"


def parts(file: ModelFile, ranges: Mapping[str, list[Field]]) -> dict[str, list[str]]:
    """Return lines of equations.c.in; nothing without a hook. ranges: of struct model."""
    if not file.hook:
        return dict.fromkeys(("modes", "modes_of_origin", "further_checks", "side_by_side"), [])
    modes = _in_effect(file, "state", "input")
    states = [f"row[{i}][0]" for i in range(len(file.of("states")))]
    inputs = [f"origin->inputs[{i}][0]" for i in range(len(file.of("inputs")))]
    return {
        "modes": modes,
        "modes_of_origin": [
            f"const double state[] = {{{', '.join(states)}}};",
            f"const double input[] = {{{', '.join(inputs)}}};",
            *modes,
        ],
        "further_checks": [
            "text[0] = '\\0';",
            f"if (!{file.path.stem}_check(values, text, size)) {{",
            "    return STATUS_INVALID_PARAMETERS;",
            "}",
        ],
        "side_by_side": [
            _side_by_side(file, ranges[key]) for key in ("inputs", "states", "dx") if ranges[key]
        ],
    }


def modes_of_values(file: ModelFile) -> list[str]:
    """Return statements that let `values` have the modes in effect at its states and inputs."""
    return _in_effect(file, _first_of(file, "states"), _first_of(file, "inputs"))


def _first_of(file: ModelFile, section: str) -> str:
    """Return the address in `values` of the first variable of a section."""
    variables = file.of(section)
    return f"&values->{file.fields.value(variables[0].name)}" if variables else "NULL"


def _in_effect(file: ModelFile, state: str, of_input: str) -> list[str]:
    call = f"{file.path.stem}_in_effect(values, {state}, {of_input}, &copy)"
    return [f"{structure(file)} copy;", f"values = {call};"]


def _side_by_side(file: ModelFile, fields: list[Field]) -> str:
    """Check that fields of one range follow each other."""
    first, last = (f"offsetof({structure(file)}, {field})" for field in (fields[0], fields[-1]))
    size = f"{len(fields) - 1} * sizeof(double)"
    return f'_Static_assert({last} - {first} == {size}, "fields are side by side");'


def parameters(file: ModelFile) -> list[str]:
    """Return the range of parameters of struct model."""
    size = f"sizeof(struct {file.path.stem}_parameters)"
    return [f".parameters = {{offsetof({structure(file)}, parameters), {size}}},"]
