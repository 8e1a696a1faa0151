# add_fmu(NAME FOLDER models/... LIBRARY target)
#
# Builds NAME.fmu in the current build folder from the model's folder (variables.toml, README.md; model.png
# and pictures of the README where there are any) and the library that defines its struct model. Targets: NAME (the shared object), NAME_fmu (the
# archive), NAME_description (struct model_description as a library), NAME_interface (the generated header with value
# references and GUID), NAME_sources (of the release: source_code.cmake; with OWN_LIBM).

set(FMU_SOURCE_DIR ${CMAKE_CURRENT_LIST_DIR})
include(${FMU_SOURCE_DIR}/release.cmake)
include(${FMU_SOURCE_DIR}/source_code.cmake)
# An adapter of FMI is a folder beside this file, and a word here; the first one gives build/NAME.fmu.
set(FMI_VERSIONS fmi2)

file(GLOB FMU_SHARED_SOURCES CONFIGURE_DEPENDS ${FMU_SOURCE_DIR}/*.c)
foreach(version IN LISTS FMI_VERSIONS)
  file(GLOB ${version}_SOURCES CONFIGURE_DEPENDS ${FMU_SOURCE_DIR}/${version}/*.c)
endforeach()

# All shared objects, without their archives.
add_custom_target(libraries)

# The shared object of one version: exports what its FMI header marks, and hides all of SUNDIALS.
function(add_fmu_library target version description folder)
  add_library(${target} SHARED ${FMU_SHARED_SOURCES} ${${version}_SOURCES})
  if(OWN_LIBM)
    # as objects: from an archive, not every linker prefers them to those of the system
    target_sources(${target} PRIVATE $<TARGET_OBJECTS:elementary_functions>)
  endif()
  set_target_properties(${target} PROPERTIES
    PREFIX "" SUFFIX ${FMU_LIBRARY_SUFFIX} ${FMU_LIBRARY_NAME}
    LIBRARY_OUTPUT_DIRECTORY ${folder} RUNTIME_OUTPUT_DIRECTORY ${folder})
  target_include_directories(${target} SYSTEM PRIVATE ${FMI_HEADERS_DIR})
  target_link_libraries(${target} PRIVATE ${description})
  target_link_options(${target} PRIVATE ${FMU_LINK_OPTIONS})
  add_dependencies(libraries ${target})
endfunction()

function(add_fmu name)
  cmake_parse_arguments(ARG "" "FOLDER;LIBRARY" "" ${ARGN})
  set(folder ${PROJECT_SOURCE_DIR}/${ARG_FOLDER})
  set(out ${CMAKE_CURRENT_BINARY_DIR}/fmu/${name})
  set(generated ${out}/modelDescription.xml ${out}/variables.c ${out}/value_references.h)

  # tables and model description, again whenever a declaration changes
  file(GLOB shared_variables CONFIGURE_DEPENDS ${PROJECT_SOURCE_DIR}/src/instance/*.toml)
  file(GLOB generator CONFIGURE_DEPENDS ${FMU_SOURCE_DIR}/declaration/*.py ${FMU_SOURCE_DIR}/fmi2/*.py)
  list(APPEND generator ${FMU_SOURCE_DIR}/generate.py ${FMU_SOURCE_DIR}/provenance.py
                        ${FMU_SOURCE_DIR}/atomic_write.py)
  set(generate ${Python3_EXECUTABLE} ${FMU_SOURCE_DIR}/generate.py ${folder}/variables.toml
               --version ${PROJECT_VERSION} --license ${PROJECT_SOURCE_DIR}/LICENSE)
  set(declaration ${folder}/variables.toml ${shared_variables} ${generator} ${PROJECT_SOURCE_DIR}/LICENSE)
  add_custom_command(
    OUTPUT ${generated}
    COMMAND ${generate} --output ${out}
    DEPENDS ${declaration}
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

  foreach(version IN LISTS FMI_VERSIONS)
    if(version STREQUAL "fmi2")
      add_fmu_library(${name} fmi2 ${name}_description ${out})
    else()
      add_fmu_library(${name}_${version} ${version} ${name}_description ${out}/${version})
    endif()
  endforeach()

  if(OWN_LIBM)
    add_source_code(${name}_sources LIBRARY ${name} FOLDER ${out}/release
                    GENERATE ${generate} DEPENDS ${declaration} ${generated})
  endif()

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

  # the archive
  set(fmu ${CMAKE_CURRENT_BINARY_DIR}/${name}.fmu)
  set(entries
      $<$<BOOL:${icon}>:model.png=${icon}>
      documentation=${out}/documentation
      documentation/licenses/license.txt=${PROJECT_SOURCE_DIR}/LICENSE
      documentation/licenses/sundials.txt=${SUNDIALS_LICENSE}
      $<$<BOOL:${OWN_LIBM}>:documentation/licenses/musl.txt=${MUSL_LICENSE}>)
  set(files ${out}/documentation/index.html ${icon} ${PROJECT_SOURCE_DIR}/LICENSE
            ${FMU_SOURCE_DIR}/package.py ${FMU_SOURCE_DIR}/atomic_write.py)
  add_custom_command(
    OUTPUT ${fmu}
    COMMAND ${Python3_EXECUTABLE} ${FMU_SOURCE_DIR}/package.py ${fmu}
            modelDescription.xml=${out}/modelDescription.xml
            binaries/${FMI2_PLATFORM}/${name}${FMU_LIBRARY_SUFFIX}=$<TARGET_FILE:${name}>
            ${entries}
    DEPENDS ${name} ${out}/modelDescription.xml ${files}
    COMMENT "Packing ${name}.fmu"
    COMMAND_EXPAND_LISTS VERBATIM)
  add_custom_target(${name}_fmu ALL DEPENDS ${fmu})
  add_release_fmu(${name} ENTRIES ${entries} DEPENDS ${files})
endfunction()
