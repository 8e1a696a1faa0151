"""Opens a page in the user's browser."""

import sys
import webbrowser
from pathlib import Path


def show(page: Path) -> None:
    """Open a page; where there is no browser, say which file to open."""
    try:
        opened = webbrowser.open_new_tab(page.absolute().as_uri())
    except webbrowser.Error:
        opened = False
    if not opened:
        print(f"no browser found, open this file in one: {page.absolute()}", file=sys.stderr)
