# add_ssp(NAME FOLDER models/... FMUS name ...)
#
# Builds NAME.ssp with the FMUs of add_fmu of FMI 2.0, and fmi3/NAME.ssp with those of FMI 3.0, in the
# current build folder from the system's folder (SystemStructure.ssd and its parameter sets,
# resources/*.ssv). Targets: NAME_ssp, NAME_fmi3_ssp.
function(add_ssp name)
  cmake_parse_arguments(ARG "" "FOLDER" "FMUS" ${ARGN})
  set(folder ${PROJECT_SOURCE_DIR}/${ARG_FOLDER})
  set(shared_files ${folder}/SystemStructure.ssd ${FMU_SOURCE_DIR}/package.py ${FMU_SOURCE_DIR}/atomic_write.py)
  set(shared_entries SystemStructure.ssd=${folder}/SystemStructure.ssd)
  file(GLOB parameter_sets CONFIGURE_DEPENDS ${folder}/resources/*.ssv)
  foreach(file ${parameter_sets})
    cmake_path(GET file FILENAME file_name)
    list(APPEND shared_files ${file})
    list(APPEND shared_entries resources/${file_name}=${file})
  endforeach()

  foreach(version IN LISTS FMI_VERSIONS)
    set(suffix ${${version}_suffix})
    set(out ${CMAKE_CURRENT_BINARY_DIR}/${${version}_below})
    set(files ${shared_files})
    set(entries ${shared_entries})
    foreach(fmu ${ARG_FMUS})
      list(APPEND files ${fmu}${suffix}_fmu ${out}${fmu}.fmu)
      list(APPEND entries resources/${fmu}.fmu=${out}${fmu}.fmu)
    endforeach()
    add_custom_command(
      OUTPUT ${out}${name}.ssp
      COMMAND ${Python3_EXECUTABLE} ${FMU_SOURCE_DIR}/package.py ${out}${name}.ssp ${entries}
      DEPENDS ${files}
      COMMENT "Packing ${${version}_below}${name}.ssp"
      VERBATIM)
    add_custom_target(${name}${suffix}_ssp ALL DEPENDS ${out}${name}.ssp)
  endforeach()
endfunction()
