"""Checks what a file with equations means: names, kinds, order and units of its expressions."""

import math
from collections.abc import Collection, Mapping
from contextlib import suppress

from ..expressions import dimensions
from ..expressions.dimensions import Dimension, dimension_of, of_exponents, times
from ..expressions.expression import (
    CONSTANTS,
    ExpressionError,
    derivative_of,
    evaluated,
    in_order,
    names,
)
from ..expressions.hints import meant
from ..expressions.indexes import with_elements
from ..expressions.kinds import CONDITION, kind_of, with_kinds
from ..expressions.parser import table_unit
from ..units import BASE, Exponents, whole
from . import contacts
from .blocks import block, groups
from .content import (
    ALGEBRAIC,
    FOLLOWS,
    OPTIONS,
    SWITCHES,
    Block,
    Expression,
    ModelFile,
    ModelFileError,
    Variable,
    placed,
    shown,
)

SECOND = of_exponents({"s": 1})
SHORTEST = 1e-12  # s, of periods
MOST_COMPARED = 1000  # names that may have been meant


def check(file: ModelFile) -> None:
    """Check all expressions, and order them: each after those that it names; ModelFileError."""
    _add_elements(file)
    _check_names(file)
    _check_derivatives(file)
    file.order = _in_order(file)
    _check_kinds(file)
    _check_periods(file)
    if file.has_units:
        _check_units(file)
    else:
        _check_numbers(file)


def _add_elements(file: ModelFile) -> None:
    """Add their elements to look-ups by indexes that follow from variables."""
    elements: dict[str, list[tuple[int, ...]]] = {}
    for name in (*file.variables, *file.modes):
        base, bracket, rest = name.partition("[")
        if bracket:
            at = tuple(map(int, rest.rstrip("]").split(",")))
            elements.setdefault(base, []).append(at)
    for expression in [*file.assigned, *file.constant, *file.initial, *file.checked]:
        if expression.is_checked:
            continue
        with placed(*expression.place):
            if any(node.op == "element" for node in in_order([expression.tree])):
                expression.tree = with_elements(expression.tree, elements)


def _check_names(file: ModelFile) -> None:
    """Check the names in all expressions."""
    rates = [derivative_of(state.name) for state in file.of("states")]
    known = dict.fromkeys((*file.variables, *file.modes, "time", *CONSTANTS, *rates))
    constant = file.of("parameters", FOLLOWS, OPTIONS)
    parameters = dict.fromkeys((*(v.name for v in constant), *CONSTANTS))
    for index in file.indexes & known.keys():
        raise ModelFileError(f"{file.place_of(index)}: {index}: this name is an index of for, too")
    inputs = dict.fromkeys(variable.name for variable in file.of("inputs", SWITCHES))
    where = dict.fromkeys(variable.name for variable in file.of(ALGEBRAIC, "where"))
    for expressions, allowed, mistake in (
        (file.assigned, known, "unknown name {}"),
        (file.constant, parameters, "{} is no parameter"),
        (file.initial, parameters | inputs, "{} is no parameter or input"),
        (file.checked, parameters | where, "{} is no parameter"),
    ):
        for expression in expressions:
            if expression.is_checked:
                continue
            with placed(*expression.place):
                for node in in_order([expression.tree]):
                    if node.op == "name" and node.name not in allowed:
                        hint = _hint(node.name, allowed, file)
                        raise ExpressionError(node.column, mistake.format(shown(node.name)) + hint)


def _check_kinds(file: ModelFile) -> None:
    """Check the kinds in all expressions; an entry of [where] that is a condition is Boolean."""
    kinds = file.kinds
    plain = {v.expression: v for v in file.of("where") if v.is_real and not v.unit}
    for expression in file.order:
        if expression.is_checked:
            continue
        with placed(*expression.place):
            if expression in plain and kind_of(expression.tree, kinds) == CONDITION:
                plain[expression].kind = expression.kind = CONDITION
                kinds[expression.target] = CONDITION
            kind = expression.kind or kind_of(expression.tree, kinds)
            expression.tree = with_kinds(expression.tree, kind, kinds)


def _check_derivatives(file: ModelFile) -> None:
    """Check that a variable is the derivative that it says it is, and no other says so."""
    found: set[str] = set()
    for variable in file.variables.values():
        state = file.variables.get(variable.derivative_of)
        if not variable.derivative_of:
            continue
        with placed(variable.place, variable.name, "derivative_of"):
            if state is None or state.section != "states":
                raise ModelFileError(f"expected a state, got {shown(variable.derivative_of)}")
            if state.expression.tree.op != "name" or state.expression.tree.name != variable.name:
                wanted = f'expected derivative = "{variable.name}" of {state.name}'
                raise ModelFileError(f"{wanted}, got {shown(state.expression.text)}")
            if state.name in found:
                raise ModelFileError(f"{state.name} has one derivative only")
            found.add(state.name)


def _hint(name: str, allowed: Collection[str], file: ModelFile) -> str:
    """Say what may have been meant by an unknown name."""
    base, bracket, _ = name.partition("[")
    count = file.dimensions.get(base, 0)
    if name in file.functions:
        return f", a function or table: write {name}(...)"
    if bracket and base in allowed:
        return f": {base} is no array"
    if count and not bracket:
        return f", expected {base}[{', '.join('ijklmn'[:count])}]"
    if count:
        elements = [other for other in allowed if other.startswith(f"{base}[")]
        return f", expected {elements[0]} .. {elements[-1]}" if elements else ""
    return meant(name, allowed) if len(allowed) <= MOST_COMPARED else ""


def _in_order(file: ModelFile) -> list[Expression]:
    """Order all expressions: [where] and [outputs] first, each after those that it names."""
    entries = {variable.name: variable for variable in file.calculated}
    entries |= {derivative_of(state.name): state for state in file.of("states")}
    found, matched = groups(entries)
    variables: list[Expression] = []
    for group in found:
        members = [entries[name] for name in group.names]
        if group.is_block:
            found_block = block(group, entries, matched)
            _add_block(file, members, found_block)
            members = [entries[n] for n in (*found_block.explicit, *found_block.unknowns)]
        elif members[0].guess is not None:
            with placed(members[0].place, members[0].name, "start"):
                raise ModelFileError("is for what is solved together with others: leave it out")
        variables += [v.guess for v in members if v.guess is not None]
        variables += [v.expression for v in members]
    happening = [expression for change in file.changes for expression in change.expressions]
    constant = [e for e in [*file.constant, *file.initial] if e.target not in entries]
    of_contacts = [e for contact in file.contacts for e in contact.moving]
    return [*variables, *of_contacts, *happening, *constant, *file.checked]


def _add_block(file: ModelFile, members: list[Variable], found: Block) -> None:
    """Note a block; ModelFileError if events or the initialization need to know its unknowns."""
    for variable in members:
        if variable.section == FOLLOWS:
            with placed(variable.place, variable.name):
                way = shown(" -> ".join([*found.names, found.names[0]]))
                raise ModelFileError(f"algebraic loop {way}: write them in [where]")
        file.blocks[variable.expression] = found


def _check_periods(file: ModelFile) -> None:
    """Check that samplers can tick, and starts exist, with the start values of the parameters."""
    given = file.of("parameters", OPTIONS, "inputs", SWITCHES)
    starts = {variable.name: variable.start for variable in given}
    follows = {variable.expression for variable in file.of(FOLLOWS)}
    for expression in file.order:
        if expression in follows and (number := _known_number(expression, starts)) is not None:
            starts[expression.target] = number
    for variable in file.started:
        with placed(*variable.initial.place):
            if not math.isfinite(_number(variable.initial, starts)):
                raise ModelFileError("is not a finite number at the start values")
    for sampler in file.sampled:
        every, offset = (_number(expression, starts) for expression in sampler.periods)
        with placed(*sampler.every.place):
            if every != 0 and not SHORTEST <= every < math.inf:
                wanted = f"expected {SHORTEST:g} s or more, or 0"
                raise ModelFileError(f"is {every:g} s at the start values, {wanted}")
        with placed(*sampler.offset.place):
            if not 0 <= offset < math.inf:
                raise ModelFileError(f"is {offset:g} s at the start values, expected 0 or more")


def _number(expression: Expression, values: Mapping[str, float]) -> float:
    """Evaluate an expression; nan if it has no value, 1 if that is known at run time only."""
    number = _known_number(expression, values)
    return 1.0 if number is None else number


def _known_number(expression: Expression, values: Mapping[str, float]) -> float | None:
    try:
        return evaluated(expression.tree, values)
    except (ArithmeticError, ValueError):
        return math.nan
    except KeyError:  # tables and functions of C: the start of a simulation checks their values
        return None


def _check_units(file: ModelFile) -> None:
    """Check that units fit, and find the units of [where]."""
    declared = [
        v for v in file.variables.values()
        if v.section != "where" or v.unit or v.display or v.expression.is_checked
    ]  # fmt: skip
    units = {v.name: of_exponents(v.exponents) for v in declared} | {"time": SECOND}
    bare = [v.name for v in declared if v.is_real and not (v.unit or v.display)]
    units |= {key: of_exponents(found) for key, found in file.table_units.items()}
    units |= dict.fromkeys(file.without_units)
    for state in file.of("states"):
        unit = units[state.name]
        units[derivative_of(state.name)] = unit and times(unit, SECOND, -1)
    of_contacts = contacts.add_units(file, units)
    for expression in file.order:
        if expression in file.blocks:
            _add_units(file, file.blocks[expression], units)
        if expression.is_checked:
            continue
        with placed(*expression.place):
            expected = of_contacts.get(expression, units.get(expression.target))
            if expression.is_rate:
                expected = times(expected, SECOND, -1)
            try:
                unit = dimension_of(expression.tree, units, expected)
            except ExpressionError as error:
                raise ModelFileError(f"{error}{_without(expression, bare, units)}") from None
        if expression.target:
            units.setdefault(expression.target, unit)
    for variable in file.of("where"):
        if not variable.is_real or variable.unit or variable.display:
            continue
        if variable.expression.is_checked:
            continue
        with placed("[where]", variable.name):
            variable.exponents = _exponents(units[variable.name] or dimensions.ONE)


def _check_numbers(file: ModelFile) -> None:
    """Check the units of numbers among themselves, in a file without others."""
    functions = [
        table_unit(name, argument)
        for name, function in file.functions.items()
        for argument in ("", *range(len(function.arguments)))
    ]
    rates = [derivative_of(state.name) for state in file.of("states")]
    units = dict.fromkeys([*file.variables, *rates, "time", *functions], dimensions.ANY)
    units |= {key: of_exponents(found) for key, found in file.table_units.items()}
    for expression in file.order:
        if not expression.is_checked:
            with placed(*expression.place):
                dimension_of(expression.tree, units)


def _without(
    expression: Expression, bare: Collection[str], units: Mapping[str, Dimension | None]
) -> str:
    """Say which unit may be missing: that of the entry, if its expression has one, or of names."""
    if expression.target in bare:
        with suppress(ExpressionError):
            dimension_of(expression.tree, units)
            return f"; {expression.target} itself has no unit"
    read = sorted(names(expression.tree).intersection(bare))
    return f"; without a unit: {', '.join(read)}" if read else ""


def _add_units(file: ModelFile, block: Block, units: dict[str, Dimension | None]) -> None:
    """Find units of entries that need each other: each is the unit of what it is added to."""
    without = [name for name in block.names if name not in units]
    units |= dict.fromkeys(without)
    for name in without:
        expression = file.variables[name].expression
        with placed(*expression.place):
            units[name] = dimension_of(expression.tree, units)


def _exponents(unit: Dimension) -> Exponents:
    if any(exponent.denominator > 2 for exponent in unit):
        text = f"has unit {dimensions.shown(unit)}, whose exponents are neither whole nor halves"
        raise ModelFileError(f"{text}: use a power of it")
    return {base: whole(exponent) for base, exponent in zip(BASE, unit, strict=True)}
