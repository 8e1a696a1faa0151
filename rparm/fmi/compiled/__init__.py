"""Steps FMUs from code that numba compiles: microseconds less a call than ctypes takes."""
