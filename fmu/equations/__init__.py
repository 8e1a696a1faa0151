"""Makes a model in C of one file with its equations.

A module imports only from lines above its own:

    graph         operations on values and conditions, and their derivatives
    model_file    the graph of a file, which equations_file reads
    c_code        a graph as statements in C
    errors        by how much values in C may be wrong
    c_series      the Taylor series of the states
    c_events      modes and events
    c_model       equations.h and equations.c: a struct model (src/model/model.h)
    declaration   what the model declares, and its page
    lock          value references that stay

The C that all models of files share is in the files *.in.
"""
