"""Writes C that is derived from functions in plain C: Jacobians, and derivatives along a curve.

    derive.py rp_equations.h "arm_jacobian = jacobian of arm_accelerations ddq by q dq" ...

models/README.md says which C it reads.
"""

import argparse
import sys
from pathlib import Path

from compiler.plain_c.text import CTextError, read
from compiler.read.header import made, origin
from compiler.write.derived import FORM, Derived, Wanted
from program import program, write_if_changed
from source_code import dependencies


@program(CTextError)
def main() -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("file", type=Path, help="header with the functions")
    parser.add_argument("wanted", nargs="+", help=FORM)
    parser.add_argument("--mode", action="append", default=[], metavar="FIELD = VALUE ...",
                        help="possible values of an int: enumerators or numbers")  # fmt: skip
    parser.add_argument("--include", type=Path, action="append", default=[], help="folder")
    parser.add_argument("--ignore", action="append", default=[], help="header that is not read")
    parser.add_argument("--output", type=Path, required=True, help="the C file")
    parser.add_argument("--depfile", type=Path, help="file for a rule of make: what was read")
    arguments = parser.parse_args()
    text = read(arguments.file, arguments.include, arguments.ignore, made)
    modes = {}
    for mode in arguments.mode:
        field, _, values = mode.partition("=")
        modes[field.strip()] = tuple(values.split())
    derived = Derived(text, modes)
    wanted = [Wanted.read(words) for words in arguments.wanted]
    result = derived.text(wanted, arguments.file.name)
    for warning in derived.warnings:
        print(warning, file=sys.stderr)
    write_if_changed(arguments.output, result)
    arguments.output.touch()
    if arguments.depfile:
        rule = dependencies(str(arguments.output), [origin(path) for path in text.files])
        arguments.depfile.write_text(rule, encoding="utf-8")


if __name__ == "__main__":
    sys.exit(main())
