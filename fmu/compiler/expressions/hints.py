"""What may have been meant by words and signs that expressions do not have."""

from collections.abc import Iterable
from difflib import get_close_matches

# what other languages have for what is here
HERE = "t=time e=exp(1) ln=log lg=log10 log2=log(x)/log(2) pow=x**y power=x**y square=x**2 sqr=x**2"
HERE += " absolute=abs fabs=abs fmin=min fmax=max minimum=min maximum=max sgn=sign signum=sign"
HERE += " clip=min(max(x,a),b) step=A_if_C_else_B heaviside=A_if_C_else_B int=floor trunc=floor"
HERE += " fix=floor fmod=mod rem=mod derivative=der ddt=der diff=der"
HERE += " arcsin=asin arccos=acos arctan=atan arctan2=atan2"
INSTEAD = dict(pair.replace("_", " ").split("=") for pair in HERE.split())
OF_NUMBERS = "only numbers have units, as in 2[rad/s]"
SIGNS = {"^": "powers are written **", "?": "write A if C else B", "&": "write and"}
SIGNS |= {":": "ranges are written 1..n", ";": "write , between arguments"}
SIGNS |= {"|": "write or", "!": "write not", "%": "write mod(x, y), which has the sign of y"}
SIGNS |= dict.fromkeys("\u2010\u2011\u2012\u2013\u2014\u2212", "no minus sign of ASCII, write -")
# of those that differ
ROUNDS_DOWN = ", which rounds down (ceil rounds negative numbers towards 0)"
NOTES = dict.fromkeys(("int", "trunc", "fix"), ROUNDS_DOWN)
NOTES |= dict.fromkeys(
    ("fmod", "rem"), ", which has the sign of the second argument, not the first"
)


def meant(name: str, known: Iterable[str]) -> str:
    """Say what may have been meant by an unknown name."""
    plain = {other.casefold(): other for other in known}
    last = name.rpartition(".")[2]
    wanted = last if last in plain else name.casefold()
    guess = INSTEAD.get(last) or "".join(plain[x] for x in get_close_matches(wanted, plain, n=1))
    return f", did you mean {guess!r}{NOTES.get(last, '')}?" if guess else ""
