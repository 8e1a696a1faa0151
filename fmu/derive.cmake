# derive(TARGET FROM header FUNCTIONS "NAME = KIND of FUNCTION [OUTPUT ...] by ARGUMENT ..." ...
#        [MODES "FIELD = VALUE ..." ...])
#
# Adds TARGET_derived.c to a library: Jacobians and derivatives along a curve of functions in plain C
# (models/README.md). Their prototypes are written by hand, in a header that this one includes. KIND:
#   jacobian     J[i + n j]: derivative of output i by variable j
#   rates        first derivatives of the outputs along a curve
#   derivatives  first and, if their pointer is not NULL, second derivatives
# MODES: possible values of ints, as enumerators or numbers; conditions on others are not resolved.
function(derive target)
  cmake_parse_arguments(ARG "" "FROM" "FUNCTIONS;MODES" ${ARGN})
  set(output ${CMAKE_CURRENT_BINARY_DIR}/${target}_derived.c)
  set(header ${CMAKE_CURRENT_SOURCE_DIR}/${ARG_FROM})
  set(modes "")
  foreach(mode IN LISTS ARG_MODES)
    list(APPEND modes --mode ${mode})
  endforeach()
  set(folders $<TARGET_PROPERTY:${target},INCLUDE_DIRECTORIES>)
  file(GLOB generator CONFIGURE_DEPENDS ${FMU_SOURCE_DIR}/compiler/*/*.py)
  add_custom_command(
    OUTPUT ${output}
    COMMAND ${Python3_EXECUTABLE} ${FMU_SOURCE_DIR}/derive.py ${header} ${ARG_FUNCTIONS} ${modes}
            "--include;$<JOIN:${folders},;--include;>" --ignore model.h
            --output ${output} --depfile ${output}.d
    DEPENDS ${header} ${generator} ${FMU_SOURCE_DIR}/derive.py ${FMU_SOURCE_DIR}/generate.py
            ${FMU_SOURCE_DIR}/program.py ${FMU_SOURCE_DIR}/source_code.py
    DEPFILE ${output}.d
    COMMENT "Deriving ${target}_derived.c"
    COMMAND_EXPAND_LISTS VERBATIM)
  target_sources(${target} PRIVATE ${output})
  target_include_directories(${target} PRIVATE ${CMAKE_CURRENT_SOURCE_DIR})
  add_custom_target(${target}_derived DEPENDS ${output})
  add_dependencies(${target} ${target}_derived)
endfunction()
