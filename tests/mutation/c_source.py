"""C sources as tokens that know their function and statement: as much of C as mutants need.

clang-format has formatted the sources: so products and pointers look different, `a * b`, `int *a`.
"""

import re
from dataclasses import dataclass, field

TOKEN = re.compile(
    r"""
    (?P<space>\s+)
  | (?P<comment>/\*.*?\*/|//[^\n]*)
  | (?P<directive>\#(?:\\\n|/\*.*?\*/|[^\n])*)
  | (?P<string>"(?:\\.|[^"\\])*"|'(?:\\.|[^'\\])*')
  | (?P<number>(?:0[xX][0-9a-fA-F]+|(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?)[uUlLfF]*)
  | (?P<name>[A-Za-z_]\w*)
  | (?P<mark><<=|>>=|\.\.\.|->|\+\+|--|<<|>>|<=|>=|==|!=|&&|\|\||[-+*/%&|^]=|.)
    """,
    re.VERBOSE | re.DOTALL,
)
CONTROL = {"if", "else", "for", "while", "do", "switch"}
OPENING = {"(": ")", "[": "]", "{": "}"}
CLOSING = set(OPENING.values())


@dataclass
class Token:
    """A piece of code, without the space and the comments around it."""

    kind: str  # name, number, string or mark
    text: str
    start: int
    end: int
    after_space: bool
    before_space: bool = False


@dataclass
class Statement:
    """Tokens up to a semicolon or a brace, and what ends them.

    Attributes
    ----------
    function : str
        Name of the function around it, empty outside of functions.
    ended_by : str
        ``;``, ``{``, ``}``, ``:`` of a label, or nothing at the end of the file.
    repeat : int
        How many statements of the function with the same text come before.
    """

    function: str
    tokens: list[Token] = field(default_factory=list)
    ended_by: str = ""
    repeat: int = 0

    def texts(self) -> list[str]:
        """Texts of the tokens."""
        return [token.text for token in self.tokens]

    def text(self) -> str:
        """The statement on one line, however it is wrapped in the source."""
        text = ""
        for token in self.tokens:
            inside = text.endswith(tuple(OPENING)) or token.text in CLOSING
            text += (" " if token.after_space and text and not inside else "") + token.text
        return text

    def nth(self, index: int) -> int:
        """How many tokens with the text of token index come before it."""
        return self.texts()[:index].count(self.tokens[index].text)


def tokenized(text: str) -> list[Token]:
    """All tokens of a source but for preprocessor directives."""
    tokens: list[Token] = []
    after_space = True
    for match in TOKEN.finditer(text):
        kind = match.lastgroup or ""
        if kind in ("space", "comment", "directive"):
            after_space = True
            if tokens:
                tokens[-1].before_space = True
            continue
        tokens.append(Token(kind, match[0], match.start(), match.end(), after_space))
        after_space = False
    return tokens


def matching(tokens: list[Token], opening: int) -> int:
    """Index of the bracket that closes the one at the index opening."""
    depth = 0
    for index in range(opening, len(tokens)):
        if tokens[index].text in OPENING:
            depth += 1
        elif tokens[index].text in CLOSING:
            depth -= 1
            if depth == 0:
                return index
    raise ValueError(f"a bracket '{tokens[opening].text}' is never closed")


def name_before_parameters(tokens: list[Token]) -> str:
    """Name of the function whose head these tokens are."""
    for first, second in zip(tokens, tokens[1:], strict=False):
        if first.kind == "name" and second.text == "(" and first.text != "__attribute__":
            return first.text
    return ""


def begins_block(statement: Statement) -> bool:
    """Whether a brace behind these tokens begins a block, not a list of values."""
    texts = statement.texts()
    if not statement.function:
        return "=" not in texts
    return not texts or any(text in CONTROL for text in texts[:2])


def statements_of(text: str) -> list[Statement]:
    """The statements of a source in their order."""
    tokens = tokenized(text)
    statements: list[Statement] = []
    seen: dict[tuple[str, str], int] = {}
    function = ""
    depth = 0  # of the blocks inside the function
    current = Statement(function)

    def finish(ended_by: str) -> None:
        nonlocal current
        if current.tokens:
            key = (current.function, current.text())
            current.ended_by = ended_by
            current.repeat = seen.get(key, 0)
            seen[key] = current.repeat + 1
            statements.append(current)
        current = Statement(function)

    index = 0
    while index < len(tokens):
        token = tokens[index]
        if token.text == "{" and begins_block(current):
            if not function and current.tokens and current.tokens[-1].text == ")":
                function = name_before_parameters(current.tokens)
                finish("{")
                depth = 1
            else:
                finish("{")
                depth += bool(function)
        elif token.text in OPENING:
            end = matching(tokens, index)
            current.tokens += tokens[index : end + 1]
            index = end
        elif token.text == "}":
            depth -= bool(function)
            ended = current
            if function and depth == 0:
                function = ""
            finish("}")
            ended.function = ended.function or ""
        elif token.text == ";" or (
            token.text == ":" and current.texts()[:1] in (["case"], ["default"])
        ):
            finish(token.text)
        else:
            current.tokens.append(token)
        index += 1
    finish("")
    return statements
