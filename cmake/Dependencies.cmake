# Finds Python, the FMI headers, the sources that are compiled into the FMUs and, for tests, Unity. setup.sh
# gets all of them.

include(FetchContent)
if(POLICY CMP0135)
  cmake_policy(SET CMP0135 NEW) # files get the time at which they are unpacked
endif()

# find_sources(NAME FILE f URL url SHA256 hash): the folder of foreign sources with the file f, as
# NAME_SOURCE_DIR: a folder that is given, else build/deps/name, else fetched from the URL.
function(find_sources name)
  cmake_parse_arguments(ARG "" "FILE;URL;SHA256" "" ${ARGN})
  string(TOLOWER ${name} folder)
  find_path(${name}_SOURCE_DIR NAMES ${ARG_FILE} PATHS ${PROJECT_SOURCE_DIR}/build/deps/${folder}
            NO_DEFAULT_PATH DOC "Folder of the sources of ${name}, with ${ARG_FILE}")
  if(NOT ${name}_SOURCE_DIR)
    FetchContent_Declare(${folder}_sources URL ${ARG_URL} URL_HASH SHA256=${ARG_SHA256})
    FetchContent_GetProperties(${folder}_sources)
    if(NOT ${folder}_sources_POPULATED)
      FetchContent_Populate(${folder}_sources)
    endif()
    set(${name}_SOURCE_DIR ${${folder}_sources_SOURCE_DIR} PARENT_SCOPE)
  elseif(NOT EXISTS ${${name}_SOURCE_DIR}/${ARG_FILE})
    message(FATAL_ERROR "${name}_SOURCE_DIR: there is no ${ARG_FILE} in ${${name}_SOURCE_DIR}")
  endif()
endfunction()

find_sources(SUNDIALS FILE src/cvode/cvode.c
  URL https://github.com/LLNL/sundials/releases/download/v6.4.1/sundials-6.4.1.tar.gz
  SHA256 7bf10a8d2920591af3fba2db92548e91ad60eb7241ab23350a9b1bc51e05e8d0)
find_sources(MUSL FILE src/math/sincos.c
  URL https://musl.libc.org/releases/musl-1.2.3.tar.gz
  SHA256 7d5b0b6062521e4627e099e4c9dc8248d32a30285e959b7eecaa780cf8cfd4a4)
include(ElementaryFunctions)
include(Sundials)

# The environment that setup.sh makes, or any Python with the packages of requirements/run.txt.
if(NOT Python3_EXECUTABLE AND EXISTS ${PROJECT_SOURCE_DIR}/build/venv/bin/python)
  set(Python3_EXECUTABLE ${PROJECT_SOURCE_DIR}/build/venv/bin/python)
endif()
find_package(Python3 3.11 REQUIRED COMPONENTS Interpreter)

if(NOT FMI_HEADERS_DIR)
  execute_process(
    COMMAND ${Python3_EXECUTABLE} -c
            "import importlib.util, pathlib; spec = importlib.util.find_spec('fmpy'); \
print(pathlib.Path(spec.origin).parent / 'c-code', end='')"
    OUTPUT_VARIABLE found ERROR_QUIET)
  set(FMI_HEADERS_DIR "${found}" CACHE PATH "Folder with fmi2Functions.h" FORCE)
endif()
if(NOT EXISTS ${FMI_HEADERS_DIR}/fmi2Functions.h)
  message(FATAL_ERROR "fmi2Functions.h was not found in '${FMI_HEADERS_DIR}': run ./setup.sh, which "
                      "installs fmpy with the FMI headers, or give -DFMI_HEADERS_DIR=")
endif()

if(BUILD_TESTING)
  find_path(UNITY_DIR NAMES src/unity.c
            PATHS ${PROJECT_SOURCE_DIR}/build/deps/unity /usr/share/cmock/vendor/unity
            NO_DEFAULT_PATH DOC "Folder of the Unity test framework, with src/unity.c")
  if(NOT UNITY_DIR)
    FetchContent_Declare(unity_source
      GIT_REPOSITORY https://github.com/ThrowTheSwitch/Unity.git
      GIT_TAG cf949f45ca6d172a177b00da21310607b97bc7a7) # v2.5.2
    FetchContent_GetProperties(unity_source)
    if(NOT unity_source_POPULATED)
      FetchContent_Populate(unity_source)
    endif()
    set(UNITY_DIR ${unity_source_SOURCE_DIR})
  endif()
  add_library(unity STATIC ${UNITY_DIR}/src/unity.c)
  target_include_directories(unity SYSTEM PUBLIC ${UNITY_DIR}/src)
  target_compile_definitions(unity PUBLIC UNITY_INCLUDE_DOUBLE)
  target_compile_options(unity PRIVATE -w)
endif()
