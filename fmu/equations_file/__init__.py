"""Reads a file with equations and checks it: what is wrong is said in one line with its place.

A module each; a module imports only from lines above its own:

    tables    what the file says, table by table
    checks    names, kinds and units of its expressions, and their order
"""
