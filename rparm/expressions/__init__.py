"""Expressions that users write: the derived values of campaigns, the equations of own models.

From the text to a value, a module each; a module imports only from lines above its own:

    numbers        numbers of files
    tree           what an expression consists of, in the order of its operations
    parser         its text; nothing of it is ever executed as Python
    kinds          numbers and conditions, each where it belongs
    units          units of expressions
    evaluation     numbers
"""
