# ZIG: the compiler zig, for cross-compiling (toolchains/zig.cmake, fmu/release.cmake): the one that -DZIG= names,
# else the Python package ziglang (./setup.sh --release installs it), else one in the PATH.
# zig_folder: its folder, with its license and C libraries.
cmake_path(SET environment NORMALIZE ${CMAKE_CURRENT_LIST_DIR}/../build/venv)
file(GLOB in_environment ${environment}/lib/python3*/site-packages/ziglang)
find_program(ZIG zig PATHS ${in_environment} NO_DEFAULT_PATH DOC "Compiler for other platforms")
find_program(ZIG zig)
set(zig_folder "")
if(ZIG)
  file(REAL_PATH ${ZIG} zig_folder)
  cmake_path(GET zig_folder PARENT_PATH zig_folder)
endif()
