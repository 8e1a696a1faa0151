"""Plain C of equations as syntax trees, and what is refused of it before it is interpreted.

A small preprocessor reads include guards and `#include`; pycparser reads the rest. The
rules that users read are in models/README.md.
"""

import re
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from pycparser import c_ast
from pycparser.c_lexer import CLexer
from pycparser.c_parser import CParser, ParseError

# nothing of them is read: sin, bool and others are known
SYSTEM_HEADERS = ("math.h", "stdbool.h", "stddef.h", "stdlib.h")
PRELUDE = "typedef _Bool bool;\ntypedef unsigned long size_t;\n"
LARGEST_TEXT = 200_000  # bytes of a file and all that it includes
DIRECTIVE = re.compile(r"#\s*(\w*)\s*(.*)")  # without spaces around
NO_LINES = {  # of C, and what to write instead
    r"(%:|\?\?=|(.*\W)?_Pragma\b).*": "of directives, only #include and include guards are read",
    r"(.*\W)?(__)?asm(__)?\b.*": "assembly is not read: write the equation in C",
}
# a comment or a string, perhaps without an end: nothing is looked at twice
COMMENT = re.compile(r"//[^\n]*|/\*.*?(?:\*/|\Z)|\"(?:\\.|[^\"\\\n])*\"?", re.DOTALL)
LONGEST_WORD = 30  # characters in a message
CONTINUED = re.compile(r"^((?:[^\n]*\\\n)+)([^\n]*)", re.MULTILINE)
PLACE = re.compile(r"(?P<file>.*?):(?P<line>\d+)(?::\d+)?: (?P<text>.*)", re.DOTALL)
# what to write instead of a statement or an expression that is no part of the equations' C
INSTEAD = {
    c_ast.While: "a while loop has no fixed number of rounds: use for (int i = 0; i < N; i++)",
    c_ast.DoWhile: "a do loop has no fixed number of rounds: use for (int i = 0; i < N; i++)",
    c_ast.Switch: "switch is not read: use if and else if",
    c_ast.Goto: "goto is not read: use if, or an early return",
    c_ast.Label: "labels are not read: use if, or an early return",
    c_ast.Break: "break is not read: use a loop with a fixed number of rounds, and if in it",
    c_ast.Continue: "continue is not read: use if in the loop",
    c_ast.Cast: "casts are not read: declare a variable of that type and give it the value",
    c_ast.Union: "unions are not read: use a struct",
}
NO_TYPES = {
    "float": "float is not read: use double",
    "char": "characters are not read: use int or an enum",
    "long": "only int is read for whole numbers",
    "short": "only int is read for whole numbers",
    "unsigned": "only int is read for whole numbers",
}


class CTextError(ValueError):
    """What is wrong with a file: its name, the line and the reason in one line."""


def refused(node: c_ast.Node | None, reason: str) -> CTextError:
    """Return the error of a place in a text."""
    places = [found.coord for found in walk(node) if found.coord] if node else []
    coord = places[0] if places else None
    return CTextError(f"{coord.file}:{coord.line}: {reason}" if coord else reason)


@dataclass
class Program:
    """Declarations of a text by their names."""

    functions: dict[str, c_ast.FuncDef] = field(default_factory=dict)
    structs: dict[str, c_ast.Struct] = field(default_factory=dict)
    typedefs: dict[str, c_ast.Node] = field(default_factory=dict)
    enumerators: dict[str, c_ast.Enumerator | None] = field(default_factory=dict)
    enums: dict[str, c_ast.Enum] = field(default_factory=dict)
    constants: dict[str, c_ast.Decl] = field(default_factory=dict)
    declared: set[str] = field(default_factory=set)  # functions without a body
    files: list[Path] = field(default_factory=list)


# ---- Preprocessor --------------------------------------------------------------------------------
class Preprocessor:
    """The text of a file with all that it includes, with marks where each line is from.

    `made` gives the text of an included header that is made, or None.
    """

    def __init__(
        self,
        made: Callable[[Path], str | None],
        folders: Iterable[Path] = (),
    ) -> None:
        self.made, self.folders = made, list(folders)
        self.defined: set[str] = set()
        self.files: list[Path] = []
        self.lines: list[str] = []
        self.room = LARGEST_TEXT

    def add(self, path: Path, shown: str, made: str | None = None) -> None:
        """Add a file; shown: its name in messages; made: its text, if it is made."""
        self.files.append(path)
        self.lines.append(f'# 1 "{shown}"')
        skipping: list[bool] = []  # of each #ifndef that is open
        text = self.content(path, shown) if made is None else made
        for number, line in enumerate(without_comments(text, shown).split("\n"), 1):
            place = f"{shown}:{number}"
            found = DIRECTIVE.fullmatch(line.strip())
            if found is None:
                for pattern, reason in NO_LINES.items():
                    if re.fullmatch(pattern, line.strip()):
                        raise CTextError(f"{place}: {reason}")
                self.lines.append("" if any(skipping) else line)
                continue
            self.directive(found[1], found[2], skipping, path, place)
            self.lines.append(f'# {number + 1} "{shown}"')
        if skipping:
            raise CTextError(f"{place}: #ifndef without #endif")

    def content(self, path: Path, shown: str) -> str:
        """Read a file."""
        try:
            if not path.is_file():
                raise CTextError(f"{shown}: no such file")
            content = path.read_bytes() if path.stat().st_size <= self.room else b""
            if not content:
                raise CTextError(f"{shown}: is empty, or has more than {LARGEST_TEXT} bytes")
            self.room -= len(content)
            return content.decode("utf-8-sig").replace("\r\n", "\n")
        except UnicodeDecodeError as error:
            line = content.count(b"\n", 0, error.start) + 1
            raise CTextError(f"{shown}:{line}: is not UTF-8: save it in this encoding") from None
        except OSError as error:
            raise CTextError(f"{shown}: cannot be read: {error.strerror}") from None

    def directive(self, name: str, rest: str, skipping: list[bool], path: Path, place: str) -> None:
        """Read a line that begins with #."""
        if name == "ifndef":
            skipping.append(rest in self.defined)
        elif name == "endif" and skipping:
            skipping.pop()
        elif any(skipping) or (name == "pragma" and rest == "once"):
            pass
        elif name == "define" and rest.isidentifier():
            self.defined.add(rest)
        elif name == "define":
            raise CTextError(
                f"{place}: macros are not read: write static const double NAME = ... or a "
                "function, and an enum for a whole number"
            )
        elif name == "include" and (header := re.fullmatch(r'<([^<>]+)>|"([^"]+)"', rest)):
            self.include(*header.groups(), path, place)
        else:
            raise CTextError(f"{place}: of directives, only #include and include guards are read")

    def include(self, system: str | None, own: str | None, path: Path, place: str) -> None:
        """Add an included file, once."""
        if (system or own) in SYSTEM_HEADERS:
            return
        if own is None:
            raise CTextError(
                f"{place}: <{system}> is not read: <math.h> and <stdbool.h> are enough"
            )
        for folder in (path.parent, *self.folders):
            header = folder / own
            made = self.made(header)
            if header.is_file() or made is not None:
                if header.resolve() not in [file.resolve() for file in self.files]:
                    self.add(header, own, made)
                return
        raise CTextError(f"{place}: {own}: no such file")


def without_comments(text: str, shown: str) -> str:
    """Replace comments by spaces, and join lines that end in a backslash."""

    def blank(found: re.Match[str]) -> str:
        if found[0].startswith("/*") and not (found[0].endswith("*/") and len(found[0]) > 3):
            line = found.string.count("\n", 0, found.start()) + 1
            raise CTextError(f"{shown}:{line}: this comment has no end")
        return found[0] if found[0].startswith('"') else re.sub(r"[^\n]", " ", found[0])

    return COMMENT.sub(blank, CONTINUED.sub(_joined, text))


def _joined(found: re.Match[str]) -> str:
    lines = found[1].count("\n")
    return found[1].replace("\\\n", "") + found[2] + "\n" * lines


# ---- Parser --------------------------------------------------------------------------------------
def read(
    path: Path | Iterable[Path],
    folders: Iterable[Path] = (),
    made: Callable[[Path], str | None] = lambda _: None,
) -> Program:
    """Read the declarations of a file, or of several as if they were one."""
    preprocessor = Preprocessor(made, folders)
    for each in [path] if isinstance(path, Path) else path:
        preprocessor.add(each, each.name)
    return parsed("\n".join(preprocessor.lines), preprocessor.files)


def parsed(text: str, files: list[Path]) -> Program:
    """Read the declarations of a text without comments and directives; its first file names it."""
    name, parser = files[0].name, CParser(lexer=_Lexer)
    try:
        tree = parser.parse(f'# 1 "prelude"\n{PRELUDE}{text}', name)
    except ParseError as error:
        raise CTextError(_rephrased(str(error), *parser.clex.last)) from None
    except RecursionError:
        reason = "this is nested too deeply: use variables for parts of it"
        raise CTextError(f"{parser.clex.last[0]}: {reason}") from None
    program = Program(files=files)
    for node in tree.ext:
        _add(program, node)
    return program


class _Lexer(CLexer):
    """Keeps place and text of the last token, for messages without a line."""

    last = ("", "")

    def token(self) -> Any:
        """Return the next token."""
        found = super().token()
        if found is not None:
            self.last = f"{self.filename}:{found.lineno}", found.value[:LONGEST_WORD]
        return found


def _rephrased(message: str, place: str, word: str) -> str:
    """Rephrase a message of pycparser for a reader who does not know parsers."""
    found = PLACE.fullmatch(message)
    if message.endswith(": At end of input"):
        return f"{place}: the file ends too early: a }} or ; is missing"
    if found is None:
        return f"{place}: {message.rpartition(': ')[2].lower()} near {word}"
    reason = found["text"]
    place = f"{found['file']}:{found['line']}"
    if reason.startswith("before: "):
        token = reason.removeprefix("before: ")[:LONGEST_WORD]
        return f"{place}: {token} does not fit here: often a ; is missing before it"
    if reason == "Invalid function definition":
        return f"{place}: this is no declaration: a type or a ; may be missing before it"
    return f"{place}: {reason[:1].lower()}{reason[1:]}"


def _add(program: Program, node: c_ast.Node) -> None:
    """Put a declaration at the top of a file into the program."""
    if isinstance(node, c_ast.FuncDef):
        name = node.decl.name
        if not isinstance(node.decl.type, c_ast.FuncDecl) or node.param_decls:
            raise refused(node.decl, f"{name} has no list of arguments: write double {name}(...)")
        if name in program.functions:
            raise refused(node.decl, f"{name} is defined twice")
        program.functions[name] = node
        _note_types(program, node)
    elif isinstance(node, c_ast.Typedef):
        program.typedefs[node.name] = node.type
        _note_types(program, node)
    elif isinstance(node, c_ast.Decl):
        _note_types(program, node)
        if isinstance(node.type, c_ast.FuncDecl):
            program.declared.add(node.name)
        elif node.init is not None and "const" not in node.quals:
            raise refused(node, f"{node.name} may change: write const in front of it")
        elif node.init is not None:
            program.constants[node.name] = node
        elif node.name is not None and "extern" not in node.storage:
            raise refused(
                node, f"{node.name} keeps a value between calls: pass it as an argument instead"
            )


def _note_types(program: Program, node: c_ast.Node) -> None:
    """Note structs and enums that are defined in a declaration."""
    for child in walk(node):
        if isinstance(child, c_ast.Struct) and child.decls is not None:
            program.structs[child.name or f"at {child.coord}"] = child
        elif isinstance(child, c_ast.Enum) and child.values is not None:
            program.enums[child.name or f"at {child.coord}"] = child
            for enumerator in child.values.enumerators:
                program.enumerators[enumerator.name] = enumerator


def walk(node: c_ast.Node) -> Iterator[c_ast.Node]:
    """Yield all nodes of a tree, each before its children."""
    todo = [node]
    while todo:
        found = todo.pop()
        yield found
        todo += [child for _, child in found.children()][::-1]


def check_function(function: c_ast.FuncDef) -> None:
    """Refuse a function with something that is no part of the equations' C."""
    declared = [node for node in walk(function) if isinstance(node, c_ast.Decl)]
    values = [node for node in declared if isinstance(node.type, c_ast.TypeDecl)]
    fixed = {node.name for node in values if "const" in node.quals}
    fixed -= {node.name for node in values if "const" not in node.quals}
    for node in walk(function):
        match node:
            case c_ast.Assignment(lvalue=c_ast.ID(name=name)) if name in fixed:
                raise refused(node, f"{name} is const: leave that out, or give another variable")
            case c_ast.IdentifierType():
                for name in NO_TYPES.keys() & set(node.names):
                    raise refused(node, NO_TYPES[name])
            case c_ast.Decl() if node is not function.decl and "static" in node.storage:
                if "const" not in node.quals:
                    reason = f"{node.name} keeps a value between calls: leave out static"
                    raise refused(node, reason)
            case c_ast.UnaryOp(op="sizeof" | "~" | "_Alignof"):
                raise refused(node, f"{node.op} is not read: write the number")
            case c_ast.BinaryOp(op="&" | "|" | "^" | "<<" | ">>"):
                raise refused(node, f"{node.op} is not read: use && || ! for conditions")
            case c_ast.BinaryOp(op="%") | c_ast.Assignment(op="%="):
                raise refused(node, "% is not read: write x - y * floor(x / y)")
            case _ if type(node) in INSTEAD:
                raise refused(node, INSTEAD[type(node)])
