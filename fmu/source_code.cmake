# add_source_code(NAME_sources LIBRARY target FOLDER folder GENERATE command ... DEPENDS file ...)
#
# Target NAME_sources: the sources of an FMU for its release, not built by default. FOLDER/sources has all
# that is compiled into the FMU's shared object, as source_code.py writes it, and FOLDER/modelDescription.xml
# names them; pack it with both. GENERATE: the command that writes the description to the folder after
# --output, with the files in the folder after --sources. DEPENDS: what that command reads.

# libraries_in(target list): the target and all static libraries that are linked into it.
function(libraries_in target list)
  if(NOT TARGET ${target} OR ${target} IN_LIST ${list})
    return()
  endif()
  set(property LINK_LIBRARIES)
  get_target_property(type ${target} TYPE)
  if(type STREQUAL "INTERFACE_LIBRARY")
    set(property INTERFACE_LINK_LIBRARIES)
  endif()
  set(found ${${list}} ${target})
  get_target_property(linked ${target} ${property})
  foreach(library IN LISTS linked)
    libraries_in(${library} found)
  endforeach()
  set(${list} ${found} PARENT_SCOPE)
endfunction()

# manifest_entry(target result): a library as an object of JSON.
function(manifest_entry target result)
  get_target_property(files ${target} SOURCES)
  get_target_property(folder ${target} SOURCE_DIR)
  list(FILTER files EXCLUDE REGEX "^\\$<TARGET_OBJECTS:") # of another library in the list
  get_target_property(own ${target} OWN_SOURCES) # of a shared object: package.cmake
  if(own)
    list(APPEND files ${own})
  endif()
  set(sources "")
  foreach(file IN LISTS files)
    cmake_path(ABSOLUTE_PATH file BASE_DIRECTORY ${folder} NORMALIZE)
    list(APPEND sources "\"${file}\"")
  endforeach()
  list(JOIN sources ", " sources)

  # the header that an option of the compiler puts in front of each file
  get_target_property(options ${target} COMPILE_OPTIONS)
  set(prelude "")
  if("${options}" MATCHES "-include \"([^\"]+)\"")
    set(prelude ${CMAKE_MATCH_1})
  endif()

  set(include "$<JOIN:$<TARGET_PROPERTY:${target},INCLUDE_DIRECTORIES>,\"$<COMMA> \">")
  set(${result} "{\"name\": \"${target}\", \"prelude\": \"${prelude}\",\n\
\"sources\": [${sources}],\n\"include\": [\"${include}\"]}" PARENT_SCOPE)
endfunction()

function(add_source_code name)
  cmake_parse_arguments(ARG "" "LIBRARY;FOLDER" "GENERATE;DEPENDS" ${ARGN})

  set(libraries "")
  libraries_in(${ARG_LIBRARY} libraries)
  set(entries "")
  foreach(library IN LISTS libraries)
    get_target_property(type ${library} TYPE)
    if(NOT type STREQUAL "INTERFACE_LIBRARY")
      manifest_entry(${library} entry)
      list(APPEND entries "${entry}")
    endif()
  endforeach()
  list(JOIN entries ",\n" entries)
  set(manifest ${ARG_FOLDER}/manifest.json)
  file(GENERATE OUTPUT ${manifest} CONTENT "{\"roots\": {
\"project\": \"${PROJECT_SOURCE_DIR}\",
\"generated\": \"${PROJECT_BINARY_DIR}\",
\"fmi\": \"${FMI_HEADERS_DIR}\",
\"sundials\": \"${SUNDIALS_SOURCE_DIR}\",
\"musl\": \"${MUSL_SOURCE_DIR}\"},
\"libraries\": [
${entries}]}
")

  set(description ${ARG_FOLDER}/modelDescription.xml)
  add_custom_command(
    OUTPUT ${description}
    COMMAND ${Python3_EXECUTABLE} ${FMU_SOURCE_DIR}/source_code.py ${manifest} --output ${ARG_FOLDER}/sources
            --depfile ${ARG_FOLDER}/sources.d --target ${description}
    COMMAND ${ARG_GENERATE} --output ${ARG_FOLDER} --sources ${ARG_FOLDER}/sources
    COMMAND ${CMAKE_COMMAND} -E touch ${description}
    DEPENDS ${FMU_SOURCE_DIR}/source_code.py ${FMU_SOURCE_DIR}/program.py ${manifest} ${ARG_DEPENDS}
    DEPFILE ${ARG_FOLDER}/sources.d
    COMMENT "Collecting ${name}"
    VERBATIM)
  add_custom_target(${name} DEPENDS ${description})
  foreach(library IN LISTS libraries)
    add_dependencies(${name} ${library}) # headers that are made with it
  endforeach()
endfunction()
