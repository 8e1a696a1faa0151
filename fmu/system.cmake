# add_ssp(NAME FOLDER models/... FMUS name ...)
#
# Builds NAME.ssp with the FMUs of add_fmu of FMI 2.0 and fmi3/NAME.ssp with those of FMI 3.0, in the current
# build folder and with the release, from loop.toml in the system's folder. Targets: NAME_ssp, NAME_fmi3_ssp; of the
# release NAME_ssp_release, NAME_fmi3_ssp_release.
function(add_ssp name)
  cmake_parse_arguments(ARG "" "FOLDER" "FMUS" ${ARGN})
  set(loop ${PROJECT_SOURCE_DIR}/${ARG_FOLDER}/loop.toml)
  file(GLOB writer CONFIGURE_DEPENDS ${PROJECT_SOURCE_DIR}/rparm/systems/*.py
       ${PROJECT_SOURCE_DIR}/rparm/templates/*.ss*)
  foreach(version IN LISTS FMI_VERSIONS)
    set(target ${name}${${version}_suffix}_ssp)
    set(below ${${version}_below})
    write_ssp(${CMAKE_CURRENT_BINARY_DIR}/${below}${name}.ssp fmu)
    add_custom_target(${target} ALL DEPENDS ${CMAKE_CURRENT_BINARY_DIR}/${below}${name}.ssp)
    if(CAN_RELEASE)
      set(released ${RELEASE_FOLDER}/${below}${name}.ssp)
      write_ssp(${released} release)
      add_custom_target(${target}_release DEPENDS ${released})
      set_property(GLOBAL APPEND PROPERTY release_files ${released})
      set_property(GLOBAL APPEND PROPERTY release_targets ${target}_release)
    endif()
  endforeach()
endfunction()

# Writes the SSP from the FMUs in its folder. kind: fmu or release, of the targets that make them.
# It uses the variables loop, version, writer and ARG_FMUS of add_ssp.
function(write_ssp ssp kind)
  cmake_path(GET ssp PARENT_PATH folder)
  set(fmus "")
  foreach(fmu ${ARG_FMUS})
    list(APPEND fmus ${fmu}${${version}_suffix}_${kind} ${folder}/${fmu}.fmu)
  endforeach()
  add_custom_command(
    OUTPUT ${ssp}
    COMMAND ${CMAKE_COMMAND} -E env PYTHONPATH=${PROJECT_SOURCE_DIR}
            ${Python3_EXECUTABLE} -m rparm.systems.ssp_writer ${loop} ${folder} ${ssp}
    DEPENDS ${loop} ${writer} ${fmus}
    COMMENT "Writing ${ssp}"
    VERBATIM)
endfunction()
