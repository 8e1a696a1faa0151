# add_ssp(NAME FOLDER models/... FMUS name ...)
#
# Builds NAME.ssp in the current build folder, and release/NAME.ssp with the release, from the system's folder
# (SystemStructure.ssd and its parameter sets, resources/*.ssv) and the FMUs of add_fmu. Targets: NAME_ssp,
# NAME_ssp_release.
function(add_ssp name)
  cmake_parse_arguments(ARG "" "FOLDER" "FMUS" ${ARGN})
  set(folder ${PROJECT_SOURCE_DIR}/${ARG_FOLDER})
  set(files ${folder}/SystemStructure.ssd ${FMU_SOURCE_DIR}/package.py ${FMU_SOURCE_DIR}/atomic_write.py)
  set(entries SystemStructure.ssd=${folder}/SystemStructure.ssd)
  file(GLOB parameter_sets CONFIGURE_DEPENDS ${folder}/resources/*.ssv)
  foreach(file ${parameter_sets})
    cmake_path(GET file FILENAME file_name)
    list(APPEND files ${file})
    list(APPEND entries resources/${file_name}=${file})
  endforeach()

  pack_ssp(${CMAKE_CURRENT_BINARY_DIR} fmu)
  add_custom_target(${name}_ssp ALL DEPENDS ${CMAKE_CURRENT_BINARY_DIR}/${name}.ssp)
  if(CAN_RELEASE)
    pack_ssp(${RELEASE_FOLDER} release)
    add_custom_target(${name}_ssp_release DEPENDS ${RELEASE_FOLDER}/${name}.ssp)
    set_property(GLOBAL APPEND PROPERTY release_files ${RELEASE_FOLDER}/${name}.ssp)
    set_property(GLOBAL APPEND PROPERTY release_targets ${name}_ssp_release)
  endif()
endfunction()

# In add_ssp: FOLDER/NAME.ssp of the FMUs in the folder, which the targets FMU_kind make.
macro(pack_ssp fmu_folder kind)
  set(fmus "")
  set(fmu_entries "")
  foreach(fmu ${ARG_FMUS})
    list(APPEND fmus ${fmu}_${kind} ${fmu_folder}/${fmu}.fmu)
    list(APPEND fmu_entries resources/${fmu}.fmu=${fmu_folder}/${fmu}.fmu)
  endforeach()
  add_custom_command(
    OUTPUT ${fmu_folder}/${name}.ssp
    COMMAND ${Python3_EXECUTABLE} ${FMU_SOURCE_DIR}/package.py ${fmu_folder}/${name}.ssp ${entries} ${fmu_entries}
    DEPENDS ${files} ${fmus}
    COMMENT "Packing ${name}.ssp"
    VERBATIM)
endmacro()
