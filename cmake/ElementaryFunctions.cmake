# Target elementary_functions: sin, cos and all other functions of libm that the project and SUNDIALS call, from musl's
# sources, so that results do not depend on the libm of the platform. FMUs link no other: a function that
# is not in the list below is missing when they are linked. Objects that use it find it first by its
# standard name; no symbol is exported.

option(OWN_LIBM "Compile musl's elementary functions into the FMUs; OFF: they call the system's" ON)

if(NOT OWN_LIBM)
  add_library(elementary_functions INTERFACE)
  target_link_libraries(elementary_functions INTERFACE m)
  return()
endif()

set(MUSL_VERSION 1.2.3)
file(STRINGS ${MUSL_SOURCE_DIR}/VERSION version)
if(NOT version STREQUAL MUSL_VERSION)
  message(FATAL_ERROR "${MUSL_SOURCE_DIR} has musl '${version}', not ${MUSL_VERSION}")
endif()
set(MUSL_LICENSE ${MUSL_SOURCE_DIR}/COPYRIGHT)

set(files
  sin cos sincos __sin __cos __rem_pio2 __rem_pio2_large scalbn
  atan2 atan
  tan __tan asin acos sinh cosh tanh __expo2 expm1
  pow pow_data exp exp_data log log_data
  __math_divzero __math_invalid __math_oflow __math_uflow __math_xflow
  sqrt sqrt_data
  ceil fabs floor fmax fmin remainder remquo)
if(WASM)
  # zig links its C library first: with other names its functions do not get in the way. Those left out are instructions.
  list(REMOVE_ITEM files sqrt sqrt_data ceil fabs floor)
  set(names "")
  foreach(name IN ITEMS ${files} __exp_data __log_data __pow_log_data)
    string(APPEND names "#define ${name} own_${name}\n")
  endforeach()
  file(CONFIGURE OUTPUT ${PROJECT_BINARY_DIR}/musl/names.h CONTENT "${names}")
  add_compile_options("SHELL:-include \"${PROJECT_BINARY_DIR}/musl/names.h\"")
endif()
list(TRANSFORM files PREPEND ${MUSL_SOURCE_DIR}/src/math/)
list(TRANSFORM files APPEND .c)

add_library(elementary_functions STATIC ${files})
target_include_directories(elementary_functions
  PRIVATE ${MUSL_SOURCE_DIR}/src/internal ${MUSL_SOURCE_DIR}/arch/generic)
# none of them is a function that the compiler knows: it would make floor of floor
target_compile_options(elementary_functions PRIVATE
  ${foreign_options} -fno-builtin $<$<CONFIG:Release>:-ffile-prefix-map=${MUSL_SOURCE_DIR}=musl>
  "SHELL:-include \"${CMAKE_CURRENT_LIST_DIR}/musl.h\"")

# headers that musl includes and not every system has: empty ones, where the system's are not found
foreach(header features endian)
  file(CONFIGURE OUTPUT ${PROJECT_BINARY_DIR}/musl/${header}.h CONTENT "")
endforeach()
target_compile_options(elementary_functions PRIVATE "SHELL:-idirafter \"${PROJECT_BINARY_DIR}/musl\"")
