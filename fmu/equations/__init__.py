"""Makes a model in C of one file with its equations, and derives C from plain C.

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

Derives C from functions in plain C, the models' own (models/README.md), by the same graph:

    c_text         syntax trees, and what is refused
    c_types        types and addresses
    c_values       whole numbers and conditions: what is known of them on a path
    c_memory       what variables hold
    c_expressions  expressions, calls of libm
    c_interpreter  statements and functions
    derivatives    first and second derivatives along a curve
    c_placement    under which conditions a value is needed
    c_blocks       values as statements in C that people read
    c_derived      the functions that are asked for

The C that all models of files share is in the files *.in.
"""
