# add_fmu(NAME EQUATIONS file.toml [FOLDER models/...] [LIBRARY target] [REFERENCES scenario ...] [VERSIONS fmi2 fmi3]
#         [DESCRIPTION_ONLY])
# add_fmu(NAME BY_HAND file.toml LIBRARY target [FOLDER models/...] ...)
#
# Builds NAME.fmu (FMI 2.0) and fmi3/NAME.fmu (FMI 3.0) in the current build folder, or the one of them that
# VERSIONS names, or with DESCRIPTION_ONLY none, from the model's file and its lock file. The folder may have a page,
# README.md, pictures of it, and model.png. The library has the C of the hook of a file with equations or, BY_HAND, the
# struct model of which the file declares the variables. The archive carries inputs and references of the scenarios
# after REFERENCES. Targets:
#   NAME_equations             the library with the struct model of EQUATIONS
#   NAME, NAME_fmi3            the shared objects
#   NAME_fmu, NAME_fmi3_fmu    the archives
#   NAME_description           struct model_description as a library
#   NAME_interface             the generated header with value references and GUID
#   NAME_sources, ..._release  for the release: source_code.cmake, release.cmake

set(FMU_SOURCE_DIR ${CMAKE_CURRENT_LIST_DIR})
include(${FMU_SOURCE_DIR}/release.cmake)
include(${FMU_SOURCE_DIR}/source_code.cmake)

# An adapter of FMI is a folder beside this file and a word here, with the suffix of its targets, the part of
# paths in the build that tells its files from those of others, the name of the icon in the archive, and whether
# that holds terminalsAndIcons.xml: importers of FMI 2.0 refuse its version, which has to be 3.0.
set(FMI_VERSIONS fmi2 fmi3)
set(fmi2_suffix "")
set(fmi2_below "")
set(fmi2_icon model.png)
set(fmi2_has_terminals OFF)
set(fmi3_suffix _fmi3)
set(fmi3_below fmi3/)
set(fmi3_icon terminalsAndIcons/icon.png)
set(fmi3_has_terminals ON)

file(GLOB FMU_SHARED_SOURCES CONFIGURE_DEPENDS ${FMU_SOURCE_DIR}/fmi/*.c)
foreach(version IN LISTS FMI_VERSIONS)
  file(GLOB ${version}_SOURCES CONFIGURE_DEPENDS ${FMU_SOURCE_DIR}/${version}/*.c)
endforeach()

# All shared objects, without their archives.
add_custom_target(libraries)

# The shared object of one version: exports what its FMI header marks, and hides all of SUNDIALS. What is the same in all is
# compiled once (runtime.cmake); its files are still the sources of the FMU (source_code.cmake).
function(add_fmu_library name target version description folder)
  add_library(${target} SHARED $<TARGET_OBJECTS:runtime_${version}>)
  set_target_properties(${target} PROPERTIES OWN_SOURCES "${FMU_SHARED_SOURCES};${${version}_SOURCES}")
  if(OWN_LIBM)
    # as objects: from an archive, not every linker prefers them to those of the system
    target_sources(${target} PRIVATE $<TARGET_OBJECTS:elementary_functions>)
  endif()
  set_target_properties(${target} PROPERTIES
    PREFIX "" OUTPUT_NAME ${name} SUFFIX ${FMU_LIBRARY_SUFFIX} ${FMU_LIBRARY_NAME}
    LIBRARY_OUTPUT_DIRECTORY ${folder} RUNTIME_OUTPUT_DIRECTORY ${folder} ARCHIVE_OUTPUT_DIRECTORY ${folder})
  target_include_directories(${target} SYSTEM PRIVATE ${FMI_HEADERS_DIR})
  target_link_libraries(${target} PRIVATE ${description})
  target_link_options(${target} PRIVATE ${FMU_LINK_OPTIONS})
  add_dependencies(libraries ${target})
endfunction()

# The library NAME_equations of a generated file.
function(add_equations name source)
  cmake_path(GET source PARENT_PATH folder)
  add_library(${name}_equations STATIC ${source})
  target_include_directories(${name}_equations PUBLIC ${folder})
  target_compile_options(${name}_equations PRIVATE -w) # what warnings are about, nobody has written
  target_link_libraries(${name}_equations PUBLIC model_interface PRIVATE relations elementary_functions
                        $<LINK_ONLY:integrator>) # the solver of a band
  add_dependencies(${name}_equations ${name}_generated)
endfunction()

# NAME_values.h, which the C files of models include, of NAME.toml.
function(add_values_header target file)
  cmake_path(ABSOLUTE_PATH file)
  cmake_path(GET file STEM name)
  set(output ${CMAKE_CURRENT_BINARY_DIR}/${name}_values.h)
  file(GLOB generator CONFIGURE_DEPENDS ${FMU_SOURCE_DIR}/compiler/*.py ${FMU_SOURCE_DIR}/compiler/read/*.py)
  add_custom_command(
    OUTPUT ${output}
    COMMAND ${Python3_EXECUTABLE} ${FMU_SOURCE_DIR}/generate.py ${file} --header
            --output ${CMAKE_CURRENT_BINARY_DIR} --depfile ${output}.d
    DEPENDS ${file} ${generator} ${FMU_SOURCE_DIR}/generate.py
    DEPFILE ${output}.d
    COMMENT "Making ${name}_values.h"
    VERBATIM)
  add_custom_target(${name}_values DEPENDS ${output})
  add_dependencies(${target} ${name}_values)
  get_target_property(type ${target} TYPE)
  set(scope PUBLIC)
  if(type STREQUAL INTERFACE_LIBRARY)
    set(scope INTERFACE)
  endif()
  target_include_directories(${target} ${scope} ${CMAKE_CURRENT_BINARY_DIR})
endfunction()

function(add_fmu name)
  cmake_parse_arguments(ARG "DESCRIPTION_ONLY" "EQUATIONS;BY_HAND;FOLDER;LIBRARY" "REFERENCES;VERSIONS" ${ARGN})
  if(NOT ARG_VERSIONS AND NOT ARG_DESCRIPTION_ONLY)
    set(ARG_VERSIONS ${FMI_VERSIONS})
  endif()
  set_property(DIRECTORY APPEND PROPERTY FMUS ${name})
  set(out ${CMAKE_CURRENT_BINARY_DIR}/fmu/${name})
  set(folder ${out})
  set(icon "")
  if(ARG_FOLDER)
    set(folder ${PROJECT_SOURCE_DIR}/${ARG_FOLDER})
    file(GLOB icon CONFIGURE_DEPENDS ${folder}/model.png)
  endif()
  set(readme ${folder}/README.md)
  set(generated ${out}/modelDescription.xml ${out}/fmi3/modelDescription.xml ${out}/terminalsAndIcons.xml
                ${out}/variables.c ${out}/value_references.h)

  # tables, model descriptions and equations
  set(model ${ARG_EQUATIONS}${ARG_BY_HAND})
  cmake_path(ABSOLUTE_PATH model BASE_DIRECTORY ${PROJECT_SOURCE_DIR})
  cmake_path(REPLACE_EXTENSION model LAST_ONLY .lock.toml OUTPUT_VARIABLE lock)
  set(generate ${Python3_EXECUTABLE} ${FMU_SOURCE_DIR}/generate.py ${model}
               --version ${PROJECT_VERSION} --license ${PROJECT_SOURCE_DIR}/LICENSE)
  if(ARG_EQUATIONS)
    list(APPEND generated ${out}/equations.c ${out}/equations.h ${out}/README.md)
  else()
    list(APPEND generate --by-hand)
  endif()
  if(icon)
    list(APPEND generate --icon ${icon})
  endif()
  file(GLOB generator CONFIGURE_DEPENDS ${FMU_SOURCE_DIR}/compiler/*.py ${FMU_SOURCE_DIR}/compiler/*/*
       ${FMU_SOURCE_DIR}/fmi*/*.py ${FMU_SOURCE_DIR}/*.xml.in ${FMU_SOURCE_DIR}/fmi*/*.xml.in
       ${PROJECT_SOURCE_DIR}/src/instance/*.toml)
  foreach(module generate description_parts program source_code)
    list(APPEND generator ${FMU_SOURCE_DIR}/${module}.py)
  endforeach()
  set(declaration ${model} ${lock} ${icon} ${generator} ${PROJECT_SOURCE_DIR}/LICENSE)
  add_custom_command(
    OUTPUT ${generated}
    COMMAND ${generate} --output ${out} --depfile ${out}/files.d
    DEPENDS ${declaration}
    DEPFILE ${out}/files.d
    COMMENT "Generating ${name}"
    VERBATIM)
  add_custom_target(${name}_generated DEPENDS ${generated})
  if(ARG_EQUATIONS)
    add_equations(${name} ${out}/equations.c)
    if(ARG_LIBRARY) # each calls the other
      target_link_libraries(${name}_equations PUBLIC ${ARG_LIBRARY})
      target_link_libraries(${ARG_LIBRARY} INTERFACE ${name}_equations)
    endif()
    set(ARG_LIBRARY ${name}_equations)
  endif()
  add_library(${name}_interface INTERFACE)
  target_include_directories(${name}_interface INTERFACE ${out})
  add_dependencies(${name}_interface ${name}_generated)

  # the description: the model with its table of variables, run by the instance
  add_library(${name}_description STATIC ${out}/variables.c)
  target_include_directories(${name}_description PUBLIC ${FMU_SOURCE_DIR}/fmi)
  target_link_libraries(${name}_description PUBLIC instance ${ARG_LIBRARY} ${name}_interface)

  # the page inside the FMU
  file(GLOB pictures CONFIGURE_DEPENDS ${folder}/*.svg ${folder}/*.png)
  file(GLOB derivation CONFIGURE_DEPENDS ${folder}/derivation.md)
  add_custom_command(
    OUTPUT ${out}/documentation/index.html
    COMMAND ${Python3_EXECUTABLE} ${FMU_SOURCE_DIR}/document.py
            --readme ${readme} ${derivation} --model-description ${out}/modelDescription.xml
            --output ${out}/documentation
    DEPENDS ${FMU_SOURCE_DIR}/document.py ${FMU_SOURCE_DIR}/document.css ${FMU_SOURCE_DIR}/document.html
            ${FMU_SOURCE_DIR}/program.py
            ${readme} ${derivation} ${pictures} ${out}/modelDescription.xml
    COMMENT "Writing the documentation of ${name}"
    VERBATIM)

  # scenarios with their references
  set(references "")
  set(reference_entries "")
  if(ARG_REFERENCES)
    set(references ${out}/references/fmi-ls-manifest.xml)
    set(layered_standard extra/org.fmi-standard.fmi-ls-ref)
    set(reference_entries ${layered_standard}/fmi-ls-manifest.xml=${references})
    set(reference_files "")
    foreach(scenario IN LISTS ARG_REFERENCES)
      list(APPEND reference_entries ${layered_standard}/${scenario}=${out}/references/${scenario})
      list(APPEND reference_files ${folder}/scenarios/${scenario}.toml)
      foreach(ending _in.csv _ref.csv _ref.opt)
        list(APPEND reference_files ${folder}/references/${scenario}/${name}${ending})
      endforeach()
    endforeach()
    add_custom_command(
      OUTPUT ${references}
      COMMAND ${Python3_EXECUTABLE} ${FMU_SOURCE_DIR}/references.py ${out}/modelDescription.xml ${ARG_REFERENCES}
              --folder ${folder} --output ${out}/references
      DEPENDS ${FMU_SOURCE_DIR}/references.py ${generator} ${out}/modelDescription.xml ${reference_files}
      COMMENT "Collecting the references of ${name}"
      VERBATIM)
  endif()

  # make runs a command in each target that needs its output: here once, before the archives
  add_custom_target(${name}_documents DEPENDS ${out}/documentation/index.html ${references})
  add_dependencies(${name}_documents ${name}_generated)

  # what the archives of all versions and platforms have in common
  set(entries
      ${reference_entries}
      documentation=${out}/documentation
      documentation/licenses/license.txt=${PROJECT_SOURCE_DIR}/LICENSE
      documentation/licenses/sundials.txt=${SUNDIALS_LICENSE}
      $<$<BOOL:${OWN_LIBM}>:documentation/licenses/musl.txt=${MUSL_LICENSE}>)
  set(files ${out}/documentation/index.html ${out}/terminalsAndIcons.xml ${references} ${icon} ${PROJECT_SOURCE_DIR}/LICENSE
            ${FMU_SOURCE_DIR}/package.py ${FMU_SOURCE_DIR}/program.py)

  foreach(version IN LISTS ARG_VERSIONS)
    set(target ${name}${${version}_suffix})
    set(below ${${version}_below})
    add_fmu_library(${name} ${target} ${version} ${name}_description ${out}/${below})
    set(own_entries ${entries})
    if(icon)
      list(APPEND own_entries ${${version}_icon}=${icon})
    endif()
    if(${version}_has_terminals)
      list(APPEND own_entries terminalsAndIcons/terminalsAndIcons.xml=${out}/terminalsAndIcons.xml)
    endif()

    set(fmu ${CMAKE_CURRENT_BINARY_DIR}/${below}${name}.fmu)
    set(description ${out}/${below}modelDescription.xml)
    folder_in_fmu(${version} ${PLATFORM} binaries)
    add_custom_command(
      OUTPUT ${fmu}
      COMMAND ${Python3_EXECUTABLE} ${FMU_SOURCE_DIR}/package.py ${fmu}
              modelDescription.xml=${description}
              binaries/${binaries}/${name}${FMU_LIBRARY_SUFFIX}=$<TARGET_FILE:${target}>
              ${own_entries}
      DEPENDS ${target} ${description} ${files}
      COMMENT "Packing ${below}${name}.fmu"
      COMMAND_EXPAND_LISTS VERBATIM)
    add_custom_target(${target}_fmu ALL DEPENDS ${fmu})
    add_dependencies(${target}_fmu ${name}_documents)

    if(OWN_LIBM)
      add_source_code(${target}_sources LIBRARY ${target} FOLDER ${out}/${below}release
                      GENERATE ${generate} --fmi ${version} DEPENDS ${declaration} ${generated})
      add_release_fmu(${name} ${version} ENTRIES ${own_entries} DEPENDS ${files})
    endif()
  endforeach()
endfunction()
