"""Writes docs/python-api.md from the docstrings of rparm.api.

build/venv/bin/python -m docs.python_api
"""

import inspect
import re
from collections.abc import Iterator
from pathlib import Path

import rparm

PAGE = Path(__file__).with_name("python-api.md")
HEAD = '''\
# Python

Made from the docstrings by `build/venv/bin/python -m docs.python_api`.
[How to install](release.md#the-wheel) the package.

The plant falls for two seconds while a torque holds it back:

```python
import numpy as np
import rparm

table = rparm.simulate(
    rparm.fmu("RPPlant", fmi=3),
    stop_time=2.0,
    step=1e-3,
    start_values={"q1": "30 deg", "m2": 1.2},
    inputs={"tau1": lambda t: 5.0 * np.sin(t), "f2": 12.0},
)
print(table["q1"][-1], table.units["q1"])
table.to_csv("fall.csv")
```

A scenario of the project, with its error, and the closed loop:

```python
swing = rparm.Scenario("hanging_swing")
errors = swing.errors(swing.run())
print(swing.title, max(errors.values()))

loop = rparm.System("closed_loop")
table = loop.run("nominal")
print(loop.variants, table["arm.q1"][-1])
```

A campaign of eight runs:

```python
from pathlib import Path

Path("payload.toml").write_text("""
title = "Payload"
description = "How far does the arm fall with another second link?"
scenario = "hanging_swing"
time = { stop = 0.5 }
sampling = "sobol"
runs = 8
[parameters.m2]
uniform = [0.5, 1.5]
[keep]
final = ["q1"]
""")
if __name__ == "__main__":  # its processes import this program
    runs = rparm.run_campaign("payload.toml", output="payload")
    print(runs["m2"], runs["final(q1)"])
```

A mistake is one line:

```python
from rparm.errors import UserError

try:
    rparm.fmu("RPPlnt")
except UserError as error:
    print(error)
```
'''


def page() -> str:
    """Text of the page."""
    return "\n".join([HEAD, *(f"{part}\n" for name in rparm.__all__ for part in _entry(name))])


def _entry(name: str) -> Iterator[str]:
    thing = getattr(rparm, name)
    parameters = ", ".join(inspect.signature(thing).parameters)
    yield f"## rparm.{name}({parameters})\n\n{_text(thing)}"
    if inspect.isclass(thing):
        for method, function in vars(thing).items():
            if inspect.isfunction(function) and not method.startswith("_"):
                parameters = ", ".join(list(inspect.signature(function).parameters)[1:])
                yield f"### {name}.{method}({parameters})\n\n{_text(function)}"


def _text(thing: object) -> str:
    """A docstring in Markdown: its sections of parameters and the like become lists."""
    lines = inspect.cleandoc(thing.__doc__).splitlines()
    text, listed = [], False
    for line, following in zip(lines, [*lines[1:], ""], strict=True):
        if line and set(line) == {"-"}:
            continue
        if following and set(following) == {"-"}:
            text.append(f"**{line}**\n")
            listed = True
        elif listed and (entry := re.fullmatch(r"([\w, ]+) : (.*)", line)):
            text.append(f"- `{entry[1]}` ({entry[2]}):")
        else:
            text.append(f"  {line.strip()}" if listed and line.startswith(" ") else line)
    return "\n".join(text)


if __name__ == "__main__":
    PAGE.write_text(page(), encoding="utf-8", newline="\n")
