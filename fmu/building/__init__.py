"""Makes FMUs of a file with equations, outside CMake: what it generates, compiled and linked.

A module each; a module imports only from lines above its own:

    runtime     what FMUs are linked with, and the compiler
    contents    what they consist of
"""
