"""Which file needs which: C files by the symbols of their objects, Python by imports; and circles.

A graph is a dictionary: from a node to the nodes that it needs, each with the reasons.
"""

import ast
import json
import re
import shlex
import subprocess
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from graphlib import CycleError, TopologicalSorter
from pathlib import Path

Graph = dict[str, dict[str, set[str]]]

COMMENT = re.compile(r"/\*.*?\*/|//[^\n]*", re.DOTALL)
MACRO = re.compile(r"^[ \t]*#[ \t]*define[ \t]+\w+(?:\([^)]*\))?(.*)$", re.MULTILINE)
DIRECTIVE = re.compile(r"^[ \t]*#.*$", re.MULTILINE)
CALL = re.compile(r"\b([A-Za-z_]\w*)\s*\(")


def add(graph: Graph, node: str, needed: str, reason: str) -> None:
    graph.setdefault(node, {}).setdefault(needed, set()).add(reason)


# ---- Circles -------------------------------------------------------------------------------------


def circles(graph: Graph) -> list[str]:
    """A circle of nodes that need each other, if there is one: who needs whom, and why."""
    try:
        TopologicalSorter(graph).prepare()
    except CycleError as error:
        nodes = error.args[1][:0:-1]  # each needs the next one
        first = nodes.index(min(nodes))
        nodes = nodes[first:] + nodes[:first]
        pairs = zip(nodes, nodes[1:] + nodes[:1], strict=True)
        texts = (f"{x} -> {y} ({', '.join(sorted(graph[x][y]))})" for x, y in pairs)
        return ["; ".join(texts)]
    return []


# ---- C -------------------------------------------------------------------------------------------


@dataclass
class Symbols:
    """Of one object file, without those that no other file sees."""

    defined: set[str] = field(default_factory=set)
    needed: set[str] = field(default_factory=set)


def objects(build: Path) -> dict[Path, Path]:
    """Object file of each C file; of one that several targets compile, the first."""
    found: dict[Path, Path] = {}
    for entry in json.loads((build / "compile_commands.json").read_text()):
        words = shlex.split(entry["command"])
        name = words[words.index("-o") + 1]
        found.setdefault(Path(entry["file"]), Path(entry["directory"]) / name)
    return found


def read_symbols(object_file: Path) -> Symbols:
    command = ["nm", "--extern-only", "--format=posix", object_file]
    listing = subprocess.run(command, capture_output=True, text=True, check=True).stdout
    symbols = Symbols()
    for line in listing.splitlines():
        name, kind = line.split()[:2]
        (symbols.needed if kind in "Uw" else symbols.defined).add(name)
    return symbols


def code_of_inline_functions(text: str) -> str:
    """What a header does rather than declares: bodies of its functions, and macros."""
    text = COMMENT.sub(" ", text).replace("\\\n", " ")
    parts = MACRO.findall(text)
    depth = 0
    for piece in re.split(r"([{}])", DIRECTIVE.sub("", text)):
        depth += {"{": 1, "}": -1}.get(piece, 0)
        if depth > 0:
            parts.append(piece)
    return " ".join(parts)


def c_graph(
    symbols: Mapping[str, Symbols], headers: Mapping[str, str], included: Mapping[str, set[str]]
) -> Graph:
    """Graph of C files and headers, by their paths.

    A C file needs those that define its symbols, and all files the headers that they include. A
    header with inline functions needs what these call, but not the C file that it declares.
    """
    graph: Graph = {}
    owners: dict[str, set[str]] = {}
    for name, of_file in symbols.items():
        for symbol in of_file.defined:
            owners.setdefault(symbol, set()).add(name)
    for name, of_file in symbols.items():
        for symbol in of_file.needed:
            for owner in owners.get(symbol, ()):
                add(graph, name, owner, symbol)
    for header, text in headers.items():
        for symbol in CALL.findall(code_of_inline_functions(text)):
            for owner in owners.get(symbol, set()) - {header.removesuffix(".h") + ".c"}:
                add(graph, header, owner, symbol)
    for name, of_file in included.items():
        for header in of_file:
            add(graph, name, header, "include")
    return graph


# ---- Python --------------------------------------------------------------------------------------


def nodes_at_run_time(tree: ast.AST) -> Iterator[ast.AST]:
    """All but what only type checkers read."""
    yield tree
    for node in ast.iter_child_nodes(tree):
        if not (isinstance(node, ast.If) and ast.unparse(node.test) == "TYPE_CHECKING"):
            yield from nodes_at_run_time(node)


def imported_modules(path: Path, root: Path) -> Iterator[str]:
    """Full names of all that a file imports at run time, of modules or what is in them.

    Relative imports begin at the file; their full names begin at the root.
    """
    for node in nodes_at_run_time(ast.parse(path.read_text())):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            above = path.relative_to(root).parts[: -node.level] if node.level else ()
            module = ".".join([*above, *([node.module] if node.module else [])])
            yield from (f"{module}.{alias.name}" for alias in node.names)


def package_graph(package: Path, root: Path) -> Graph:
    """Return the graph of the folders and modules directly in a package below `root`."""
    graph: Graph = {}
    prefix = ".".join(package.relative_to(root).parts) + "."
    own = {path.stem for path in package.iterdir() if path.is_dir() or path.suffix == ".py"}
    for path in sorted(package.rglob("*.py")):
        below = path.relative_to(package)
        node = Path(below.parts[0]).stem
        for name in imported_modules(path, root):
            needed = name.removeprefix(prefix).split(".")[0]
            if name.startswith(prefix) and needed in own - {node}:
                add(graph, node, needed, f"{below.as_posix()}: {name}")
    return graph
