"""Prints the motion of a file with equations as JSON: what a proof needs of it."""

import argparse
import json
import sys
from pathlib import Path

from compiler.read.model_file import ModelFileError, read
from compiler.write.motion import motion
from program import WrongInputError


def main() -> int:
    """Print it; 2 with a line on standard error where something is wrong."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("file", type=Path, help="the file of the model")
    parser.add_argument("--output", type=Path, help="a file for it")
    arguments = parser.parse_args()
    try:
        file = read(arguments.file)
        if file.hook:  # its C decides when events are
            expected = "expected a model whose motion can be proven, got one with events in C"
            raise WrongInputError(f"{arguments.file}: [hook]: {expected}")
        text = json.dumps(motion(file))
        if arguments.output:
            arguments.output.write_text(text, encoding="utf-8")
        else:
            print(text)
    except (ModelFileError, WrongInputError, OSError) as error:
        print(f"{error!s:.2000}", file=sys.stderr)
        return 2
    return 0


if __name__ == "__main__":
    sys.exit(main())
