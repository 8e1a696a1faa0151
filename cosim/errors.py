"""Errors whose text is meant for the user."""


class UserError(Exception):
    """Something the user can put right.

    Its text is one line: the file, the key, what was wrong and what was expected.
    """
