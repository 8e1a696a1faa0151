set(CMAKE_SYSTEM_NAME Windows)
set(CMAKE_SYSTEM_PROCESSOR AMD64)
set(ZIG_TARGET x86_64-windows-gnu)
# also when CMake tries the compiler: with other options zig would build another C library, for minutes
set(ZIG_OPTIONS -O3 -s)
include(${CMAKE_CURRENT_LIST_DIR}/zig.cmake)
set(CMAKE_SHARED_LINKER_FLAGS_INIT -Wl,/Brepro) # no date in the file
