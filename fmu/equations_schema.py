"""Prints the JSON Schema of files with equations, by which editors complete and check them."""

import json

from compiler.schema import schema

if __name__ == "__main__":
    print(json.dumps(schema(), indent=2))
