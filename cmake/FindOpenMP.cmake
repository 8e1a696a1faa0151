# Stands in for CMake's own module: the package of SUNDIALS asks for OpenMP on behalf of a vector type
# that is not used here, and clang brings no OpenMP by itself.
set(OpenMP_FOUND TRUE)
