# The C compiler of zig for another platform: clang with the C libraries and linkers of all of them. Included
# by the files beside this one, which set ZIG_TARGET, CMAKE_SYSTEM_NAME and CMAKE_SYSTEM_PROCESSOR.

include(${CMAKE_CURRENT_LIST_DIR}/../FindZig.cmake)
if(NOT ZIG)
  message(FATAL_ERROR "zig was not found: run ./setup.sh --release, or give -DZIG=")
endif()
list(APPEND CMAKE_TRY_COMPILE_PLATFORM_VARIABLES ZIG)

# -O3 -s also when CMake tries the compiler: with other options zig would build another C library, for minutes
set(CMAKE_C_COMPILER ${ZIG} cc -target ${ZIG_TARGET} -fno-sanitize=undefined -O3 -s)
# they know the objects of all platforms
find_program(CMAKE_AR NAMES llvm-ar llvm-ar-14 REQUIRED)
find_program(CMAKE_RANLIB NAMES llvm-ranlib llvm-ranlib-14 REQUIRED)

# zig builds the C library of each target once and keeps it: here, not in the user's home
cmake_path(SET cache NORMALIZE ${CMAKE_CURRENT_LIST_DIR}/../../build/zig)
set(ENV{ZIG_GLOBAL_CACHE_DIR} ${cache})
set(ENV{ZIG_LOCAL_CACHE_DIR} ${cache})
set(with_cache ${CMAKE_COMMAND} -E env ZIG_GLOBAL_CACHE_DIR=${cache} ZIG_LOCAL_CACHE_DIR=${cache})
set(CMAKE_C_COMPILER_LAUNCHER ${with_cache})
set(CMAKE_C_LINKER_LAUNCHER ${with_cache})
