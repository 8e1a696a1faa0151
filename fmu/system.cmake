# add_ssp(NAME FOLDER models/... FMUS name ...)
#
# Builds NAME.ssp with the FMUs of add_fmu of FMI 2.0 and fmi3/NAME.ssp with those of FMI 3.0, in the current
# build folder and with the release, from the system's folder (SystemStructure.ssd and its parameter sets,
# resources/*.ssv). Targets: NAME_ssp, NAME_fmi3_ssp; of the release NAME_ssp_release, NAME_fmi3_ssp_release.
function(add_ssp name)
  cmake_parse_arguments(ARG "" "FOLDER" "FMUS" ${ARGN})
  set(folder ${PROJECT_SOURCE_DIR}/${ARG_FOLDER})
  set(files ${folder}/SystemStructure.ssd ${FMU_SOURCE_DIR}/package.py ${FMU_SOURCE_DIR}/program.py)
  set(entries SystemStructure.ssd=${folder}/SystemStructure.ssd)
  file(GLOB parameter_sets CONFIGURE_DEPENDS ${folder}/resources/*.ssv)
  foreach(file ${parameter_sets})
    cmake_path(GET file FILENAME file_name)
    list(APPEND files ${file})
    list(APPEND entries resources/${file_name}=${file})
  endforeach()

  foreach(version IN LISTS FMI_VERSIONS)
    set(target ${name}${${version}_suffix}_ssp)
    set(below ${${version}_below})
    pack_ssp(${CMAKE_CURRENT_BINARY_DIR}/${below}${name}.ssp fmu)
    add_custom_target(${target} ALL DEPENDS ${CMAKE_CURRENT_BINARY_DIR}/${below}${name}.ssp)
    if(CAN_RELEASE)
      set(released ${RELEASE_FOLDER}/${below}${name}.ssp)
      pack_ssp(${released} release)
      add_custom_target(${target}_release DEPENDS ${released})
      set_property(GLOBAL APPEND PROPERTY release_files ${released})
      set_property(GLOBAL APPEND PROPERTY release_targets ${target}_release)
    endif()
  endforeach()
endfunction()

# In add_ssp: the system, of the FMUs beside it, which the targets FMU_kind make.
function(pack_ssp ssp kind)
  cmake_path(GET ssp PARENT_PATH fmu_folder)
  set(fmus "")
  set(fmu_entries "")
  foreach(fmu ${ARG_FMUS})
    list(APPEND fmus ${fmu}${${version}_suffix}_${kind} ${fmu_folder}/${fmu}.fmu)
    list(APPEND fmu_entries resources/${fmu}.fmu=${fmu_folder}/${fmu}.fmu)
  endforeach()
  add_custom_command(
    OUTPUT ${ssp}
    COMMAND ${Python3_EXECUTABLE} ${FMU_SOURCE_DIR}/package.py ${ssp} ${entries} ${fmu_entries}
    DEPENDS ${files} ${fmus}
    COMMENT "Packing ${ssp}"
    VERBATIM)
endfunction()
