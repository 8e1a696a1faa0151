"""`list`: name the scenarios, without any FMU."""

import argparse

from cosim import project, scenario


def run(_: argparse.Namespace) -> int:
    """Print the name and the title of every scenario."""
    titles = {name: scenario.title(path) for name, path in project.scenario_files().items()}
    width = max(map(len, titles), default=0)
    for name, title in titles.items():
        print(f"{name:<{width}}  {title}")
    return 0
