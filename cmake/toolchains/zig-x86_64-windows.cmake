set(CMAKE_SYSTEM_NAME Windows)
set(CMAKE_SYSTEM_PROCESSOR AMD64)
set(ZIG_TARGET x86_64-windows-gnu)
include(${CMAKE_CURRENT_LIST_DIR}/zig.cmake)
# no date in the files
set(CMAKE_SHARED_LINKER_FLAGS_INIT -Wl,/Brepro)
set(CMAKE_EXE_LINKER_FLAGS_INIT -Wl,/Brepro)
