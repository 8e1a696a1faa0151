# The C compiler of zig for another platform: clang with the C libraries and linkers of all of them. ZIG_TARGET, from the
# preset: processor, system and C library as zig names them.

if(ZIG_TARGET MATCHES "-linux-")
  set(CMAKE_SYSTEM_NAME Linux)
elseif(ZIG_TARGET MATCHES "-windows-")
  set(CMAKE_SYSTEM_NAME Windows)
  set(no_date -Wl,/Brepro) # in the files
elseif(ZIG_TARGET MATCHES "-macos")
  set(CMAKE_SYSTEM_NAME Darwin)
elseif(ZIG_TARGET MATCHES "-wasi$")
  set(CMAKE_SYSTEM_NAME Generic) # CMake 3.21 takes WebAssembly for a bare processor
else()
  message(FATAL_ERROR "ZIG_TARGET names no platform: use a preset")
endif()
set(CMAKE_SHARED_LINKER_FLAGS_INIT ${no_date})
set(CMAKE_EXE_LINKER_FLAGS_INIT ${no_date})
string(REGEX MATCH "^[^-]+" CMAKE_SYSTEM_PROCESSOR ${ZIG_TARGET})

include(${CMAKE_CURRENT_LIST_DIR}/../FindZig.cmake)
if(NOT ZIG)
  message(FATAL_ERROR "zig was not found: run ./setup.sh --release, or give -DZIG=")
endif()
list(APPEND CMAKE_TRY_COMPILE_PLATFORM_VARIABLES ZIG ZIG_TARGET)

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
