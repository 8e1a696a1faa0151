"""Makes a model in C of one file with its equations: read, one graph, write.

A folder or module imports only from lines above its own:

    units         symbols of units, and what numbers with them are in SI
    interface     what an FMU declares: variables, units, terminals
    expressions   what users write, and its dimensions
    graph         operations on values and conditions, and their derivatives; tables
    names         names in C that follow from a file and its variables
    plain_c       interprets functions in plain C, as values of a graph
    read          a file with equations, checked, and its graph
    write         C, declaration, page and lock file of a model
    schema        by which editors check files

The C that all models of files share is in the files *.in of write.
"""
