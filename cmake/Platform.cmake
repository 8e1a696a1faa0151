# What differs between platforms and compilers: names in an FMU, and flags.

# ---- Names

# PLATFORM: folder of the binary in an archive of FMI 3.0
string(TOLOWER "${CMAKE_SYSTEM_NAME}-${CMAKE_SYSTEM_PROCESSOR}" system)
if(system STREQUAL "generic-wasm32")
  set(WASM ON)
  set(system wasi-wasm32)
elseif(NOT system MATCHES "^(linux|windows|darwin)-(x86_64|amd64|aarch64|arm64)$")
  message(FATAL_ERROR "FMUs have no name for the platform ${CMAKE_SYSTEM_NAME} ${CMAKE_SYSTEM_PROCESSOR}")
endif()
string(REGEX REPLACE "(.*)-(.*)" "\\2-\\1" PLATFORM ${system})
string(REPLACE amd64 x86_64 PLATFORM ${PLATFORM})
string(REPLACE arm64 aarch64 PLATFORM ${PLATFORM})

# folder_in_fmu(version platform result): folder of the binary in an archive. FMI 2.0 has no name for Arm.
function(folder_in_fmu version platform result)
  set(folder ${platform})
  if(version STREQUAL "fmi2")
    string(REGEX REPLACE ".*-darwin$" darwin64 folder ${folder}) # one library for both processors
    string(REPLACE x86_64-linux linux64 folder ${folder})
    string(REPLACE x86_64-windows win64 folder ${folder})
  endif()
  set(${result} ${folder} PARENT_SCOPE)
endfunction()

if(WIN32)
  set(FMU_LIBRARY_SUFFIX .dll)
elseif(APPLE)
  set(FMU_LIBRARY_SUFFIX .dylib)
elseif(WASM)
  set(FMU_LIBRARY_SUFFIX .wasm)
else()
  set(FMU_LIBRARY_SUFFIX .so)
endif()

# ---- Flags of all that is compiled

set(CMAKE_C_VISIBILITY_PRESET hidden)

# Fused multiply-adds would give other bits from one compiler to the next, and break the exact sums of
# src/instance/clock.h.
set(language_options -ffp-contract=off)
# Callbacks and functions of standards have parameters that not every implementation needs.
set(warning_options -Wall -Wextra -Wpedantic -Wconversion -Wshadow -Wmissing-prototypes -Wno-unused-parameter -Werror)

# Of sources that are not the project's own: they are taken as they are, and not all of them is used.
set(foreign_options -w $<$<C_COMPILER_ID:GNU>:-fno-analyzer>)

# Paths of the build do not appear in the binaries: two builds in two folders are the same.
set(reproducible_options
  $<$<CONFIG:Release>:-ffile-prefix-map=${PROJECT_BINARY_DIR}=build>
  $<$<CONFIG:Release>:-ffile-prefix-map=${PROJECT_SOURCE_DIR}=.>)

# Protecting the stack costs a comparison in functions with arrays; sanitizers check the stack themselves.
set(hardening_options
  -fstack-protector-strong
  $<$<CONFIG:Release>:-U_FORTIFY_SOURCE>
  $<$<CONFIG:Release>:-D_FORTIFY_SOURCE=2>)

# ---- The shared object in an FMU: unused sections are left out, undefined symbols are errors, and it is read-only
# where it can be. What it exports is marked in the FMI header.

list(APPEND language_options -ffunction-sections -fdata-sections)
if(PLATFORM MATCHES "^x86_64")
  # gcc would copy and clear structures by rep movs and rep stos, which start slowly: FMI 3.0 took up to 1.13 of 2.0 by that
  foreach(function memcpy memset)
    list(APPEND language_options
      $<$<C_COMPILER_ID:GNU>:-m${function}-strategy=unrolled_loop:128:noalign,libcall:-1:noalign>)
  endforeach()
endif()
set(FMU_LIBRARY_NAME NO_SONAME ON)
if(WIN32)
  # printf of C99; the libraries that would check stacks and buffers are not on every Windows
  list(APPEND language_options -D__USE_MINGW_ANSI_STDIO=1)
  # its isfinite is a choice between float and double
  list(APPEND warning_options $<$<C_COMPILER_ID:GNU>:-Wno-float-conversion>)
  set(hardening_options)
  set(FMU_LINK_OPTIONS -static -Wl,--gc-sections $<$<CONFIG:Release>:-s>)
elseif(APPLE)
  set(FMU_LIBRARY_NAME INSTALL_NAME_DIR @rpath BUILD_WITH_INSTALL_NAME_DIR ON) # not its path
  # clang would make one call of libSystem of them
  list(APPEND language_options -fno-builtin-sin -fno-builtin-cos)
  set(FMU_LINK_OPTIONS -Wl,-dead_strip $<$<CONFIG:Release>:-s>)
elseif(WASM)
  # a module that is loaded at no other address, with what its host calls besides FMI: memory for arguments,
  # and the table that the host adds its logger to
  set(CMAKE_POSITION_INDEPENDENT_CODE OFF)
  set_property(GLOBAL PROPERTY TARGET_SUPPORTS_SHARED_LIBS ON)
  set(CMAKE_SHARED_LIBRARY_C_FLAGS "")
  set(CMAKE_SHARED_LIBRARY_CREATE_C_FLAGS -mexec-model=reactor)
  list(APPEND warning_options -Wno-pass-failed) # no loop is vectorized
  set(hardening_options)
  set(FMU_LINK_OPTIONS
    -Wl,--export-dynamic -Wl,--export=malloc -Wl,--export=free -Wl,--export-table -Wl,--growable-table
    -Wl,-z,stack-size=1048576 $<$<CONFIG:Release>:-s>)
else()
  set(FMU_LINK_OPTIONS
    -Wl,--gc-sections -Wl,--no-undefined -Wl,--as-needed -Wl,-z,relro,-z,now,-z,noexecstack
    $<$<CONFIG:Release>:-s>)
endif()
