set(CMAKE_SYSTEM_NAME Windows)
set(CMAKE_SYSTEM_PROCESSOR AMD64)
set(CMAKE_C_COMPILER x86_64-w64-mingw32-gcc)
set(CMAKE_SHARED_LINKER_FLAGS_INIT -Wl,--no-insert-timestamp) # no date in the file
