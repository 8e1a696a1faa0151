# Finds SUNDIALS, Python, the FMI headers and, for tests, Unity. setup.sh installs all of them.

find_package(SUNDIALS REQUIRED COMPONENTS arkode cvode)
if(NOT TARGET SUNDIALS::cvode_static OR NOT TARGET SUNDIALS::arkode_static)
  message(FATAL_ERROR "SUNDIALS has no static CVODE or ARKODE: the FMU must not need a SUNDIALS library where "
                      "it runs. Install libsundials-dev, or build SUNDIALS with "
                      "-DBUILD_STATIC_LIBS=ON and position independent code.")
endif()
find_file(sundials_config sundials/sundials_config.h NO_CACHE
          HINTS ${SUNDIALS_INCLUDE_DIR} ${SUNDIALS_DIR}/../../../../include)
if(sundials_config)
  file(STRINGS ${sundials_config} with_mpi REGEX "^#define SUNDIALS_MPI_ENABLED +1")
  file(STRINGS ${sundials_config} before_7 REGEX "^#define SUNDIALS_VERSION_MAJOR +[456]$")
  if(with_mpi AND NOT before_7)
    message(FATAL_ERROR "SUNDIALS at ${SUNDIALS_DIR} is built with MPI (Debian 13's is), which from version 7 on the FMU "
                        "would need where it runs. Build SUNDIALS with -DENABLE_MPI=OFF and give its "
                        "place with -DSUNDIALS_DIR=")
  endif()
endif()
find_file(SUNDIALS_LICENSE NAMES copyright LICENSE NO_DEFAULT_PATH
          PATHS /usr/share/doc/libsundials-dev ${SUNDIALS_DIR}/../../.. ${SUNDIALS_DIR}/../../../..
                ${SUNDIALS_DIR}/../../../include/sundials
          DOC "License text of SUNDIALS, which is part of the FMU")
if(NOT SUNDIALS_LICENSE)
  message(FATAL_ERROR "The license of SUNDIALS, which the FMU has to carry, was not found: give its "
                      "path with -DSUNDIALS_LICENSE=")
endif()

# The environment that setup.sh makes, or any Python that has what requirements.txt lists.
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
    include(FetchContent)
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
