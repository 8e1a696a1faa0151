"""Makes a model in C of one file with its equations.

A module each; a module imports only from lines above its own:

    graph         operations on values and conditions, and their derivatives
    file_tables   what the file says, table by table
    model_file    reads the file and checks its expressions; what they mean as a graph
    c_code        a graph as statements in C
    guards        when a relation matters
    c_series      the Taylor series of the states
    c_events      modes and events
    c_model       equations.h and equations.c: a struct model (src/model/model.h)
    declaration   variables.toml and the page

The C that all models share is in the files *.in.
"""
