# add_fmu(NAME FOLDER models/... LIBRARY target [VERSIONS fmi2 fmi3])
#
# Builds NAME.fmu (FMI 2.0) and fmi3/NAME.fmu (FMI 3.0) in the current build folder, or one of them,
# from the model's folder (variables.toml, README.md; model.png
# and pictures of the README where there are any) and the library that defines its struct model. Targets: NAME (the shared object), NAME_fmu (the
# archive), NAME_description (struct model_description as a library), NAME_interface (the generated header with value
# references and GUID).

set(FMU_SOURCE_DIR ${CMAKE_CURRENT_LIST_DIR})
# An adapter of FMI is a folder beside this file, and a word here.
set(FMI_VERSIONS fmi2 fmi3)

include(${FMU_SOURCE_DIR}/fmi3/archive.cmake)

file(GLOB FMU_SHARED_SOURCES CONFIGURE_DEPENDS ${FMU_SOURCE_DIR}/*.c)
foreach(version IN LISTS FMI_VERSIONS)
  file(GLOB ${version}_SOURCES CONFIGURE_DEPENDS ${FMU_SOURCE_DIR}/${version}/*.c)
endforeach()

# The shared object of one version: exports what its FMI header marks, and hides all of SUNDIALS.
function(add_fmu_library target version description folder)
  add_library(${target} MODULE ${FMU_SHARED_SOURCES} ${${version}_SOURCES})
  set_target_properties(${target} PROPERTIES PREFIX "" SUFFIX ${FMU_LIBRARY_SUFFIX}
                        LIBRARY_OUTPUT_DIRECTORY ${folder})
  target_include_directories(${target} SYSTEM PRIVATE ${FMI_HEADERS_DIR})
  target_link_libraries(${target} PRIVATE ${description})
  target_link_options(${target} PRIVATE ${FMU_LINK_OPTIONS})
endfunction()

function(add_fmu name)
  cmake_parse_arguments(ARG "" "FOLDER;LIBRARY" "VERSIONS" ${ARGN})
  if(NOT ARG_VERSIONS)
    set(ARG_VERSIONS ${FMI_VERSIONS})
  endif()
  set(folder ${PROJECT_SOURCE_DIR}/${ARG_FOLDER})
  set(out ${CMAKE_CURRENT_BINARY_DIR}/fmu/${name})
  set(generated ${out}/modelDescription.xml ${out}/fmi3/modelDescription.xml ${out}/variables.c
                ${out}/value_references.h)

  # tables and model description, again whenever a declaration changes
  file(GLOB shared_variables CONFIGURE_DEPENDS ${PROJECT_SOURCE_DIR}/src/instance/*.toml)
  file(GLOB generator CONFIGURE_DEPENDS ${FMU_SOURCE_DIR}/declaration/*.py ${FMU_SOURCE_DIR}/fmi*/*.py)
  list(APPEND generator ${FMU_SOURCE_DIR}/generate.py ${FMU_SOURCE_DIR}/provenance.py
                        ${FMU_SOURCE_DIR}/description_parts.py ${FMU_SOURCE_DIR}/atomic_write.py)
  add_custom_command(
    OUTPUT ${generated}
    COMMAND ${Python3_EXECUTABLE} ${FMU_SOURCE_DIR}/generate.py ${folder}/variables.toml
            --output ${out} --version ${PROJECT_VERSION} --license ${PROJECT_SOURCE_DIR}/LICENSE
    DEPENDS ${folder}/variables.toml ${shared_variables} ${generator} ${PROJECT_SOURCE_DIR}/LICENSE
    COMMENT "Generating the interface of ${name}"
    VERBATIM)
  add_custom_target(${name}_generated DEPENDS ${generated})
  add_library(${name}_interface INTERFACE)
  target_include_directories(${name}_interface INTERFACE ${out})
  add_dependencies(${name}_interface ${name}_generated)

  # the description: the model with its table of variables, run by the instance
  add_library(${name}_description STATIC ${out}/variables.c)
  target_include_directories(${name}_description PUBLIC ${FMU_SOURCE_DIR})
  target_link_libraries(${name}_description PUBLIC instance ${ARG_LIBRARY} ${name}_interface)

  foreach(version IN LISTS ARG_VERSIONS)
    if(version STREQUAL "fmi2")
      add_fmu_library(${name} fmi2 ${name}_description ${out})
    else()
      add_fmu_library(${name}_${version} ${version} ${name}_description ${out}/${version})
      set_target_properties(${name}_${version} PROPERTIES OUTPUT_NAME ${name})
    endif()
  endforeach()

  # the page inside the FMU
  file(GLOB pictures CONFIGURE_DEPENDS ${folder}/*.svg)
  file(GLOB icon CONFIGURE_DEPENDS ${folder}/model.png)
  add_custom_command(
    OUTPUT ${out}/documentation/index.html
    COMMAND ${Python3_EXECUTABLE} ${FMU_SOURCE_DIR}/document.py
            --readme ${folder}/README.md --model-description ${out}/modelDescription.xml
            --output ${out}/documentation
    DEPENDS ${FMU_SOURCE_DIR}/document.py ${FMU_SOURCE_DIR}/document.css
            ${FMU_SOURCE_DIR}/latex_to_mathml.py ${FMU_SOURCE_DIR}/atomic_write.py
            ${folder}/README.md ${pictures} ${out}/modelDescription.xml
    COMMENT "Writing the documentation of ${name}"
    VERBATIM)

  if("fmi3" IN_LIST ARG_VERSIONS)
    add_fmi3_archive(${name} ${out})
  endif()
  if(NOT "fmi2" IN_LIST ARG_VERSIONS)
    return()
  endif()

  # the archive
  set(fmu ${CMAKE_CURRENT_BINARY_DIR}/${name}.fmu)
  add_custom_command(
    OUTPUT ${fmu}
    COMMAND ${Python3_EXECUTABLE} ${FMU_SOURCE_DIR}/package.py ${fmu}
            modelDescription.xml=${out}/modelDescription.xml
            $<$<BOOL:${icon}>:model.png=${icon}>
            binaries/${FMI2_PLATFORM}/${name}${FMU_LIBRARY_SUFFIX}=$<TARGET_FILE:${name}>
            documentation=${out}/documentation
            documentation/licenses/license.txt=${PROJECT_SOURCE_DIR}/LICENSE
            documentation/licenses/sundials.txt=${SUNDIALS_LICENSE}
            $<$<BOOL:${OWN_LIBM}>:documentation/licenses/musl.txt=${MUSL_LICENSE}>
    DEPENDS ${name} ${out}/modelDescription.xml ${out}/documentation/index.html
            ${icon} ${PROJECT_SOURCE_DIR}/LICENSE ${FMU_SOURCE_DIR}/package.py
            ${FMU_SOURCE_DIR}/atomic_write.py
    COMMENT "Packing ${name}.fmu"
    COMMAND_EXPAND_LISTS VERBATIM)
  add_custom_target(${name}_fmu ALL DEPENDS ${fmu})
endfunction()

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
