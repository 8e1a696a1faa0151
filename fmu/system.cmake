# add_ssp(NAME FOLDER models/... FMUS name ...)
#
# Builds NAME.ssp in the current build folder from the system's folder (SystemStructure.ssd and its
# parameter sets, resources/*.ssv) and the FMUs of add_fmu. Target: NAME_ssp.
function(add_ssp name)
  cmake_parse_arguments(ARG "" "FOLDER" "FMUS" ${ARGN})
  set(folder ${PROJECT_SOURCE_DIR}/${ARG_FOLDER})
  set(ssp ${CMAKE_CURRENT_BINARY_DIR}/${name}.ssp)
  set(files ${folder}/SystemStructure.ssd)
  set(entries SystemStructure.ssd=${folder}/SystemStructure.ssd)
  file(GLOB parameter_sets CONFIGURE_DEPENDS ${folder}/resources/*.ssv)
  foreach(file ${parameter_sets})
    cmake_path(GET file FILENAME file_name)
    list(APPEND files ${file})
    list(APPEND entries resources/${file_name}=${file})
  endforeach()
  foreach(fmu ${ARG_FMUS})
    list(APPEND files ${fmu}_fmu ${CMAKE_CURRENT_BINARY_DIR}/${fmu}.fmu)
    list(APPEND entries resources/${fmu}.fmu=${CMAKE_CURRENT_BINARY_DIR}/${fmu}.fmu)
  endforeach()
  add_custom_command(
    OUTPUT ${ssp}
    COMMAND ${Python3_EXECUTABLE} ${FMU_SOURCE_DIR}/package.py ${ssp} ${entries}
    DEPENDS ${files} ${FMU_SOURCE_DIR}/package.py ${FMU_SOURCE_DIR}/atomic_write.py
    COMMENT "Packing ${name}.ssp"
    VERBATIM)
  add_custom_target(${name}_ssp ALL DEPENDS ${ssp})
endfunction()
