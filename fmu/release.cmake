# Target release: build/release/NAME.fmu and fmi3/NAME.fmu with the binaries of all platforms and the sources, what else is
# built for them (built.py), the wheel, checksums and a bill of materials. Each platform is built by its preset
# (CMakePresets.json) in build/platforms.

set(RELEASE_PLATFORMS x86_64-linux x86_64-windows x86_64-darwin aarch64-darwin aarch64-linux)
set(RELEASE_FOLDER ${PROJECT_BINARY_DIR}/release)

include(FindZig)
set(mingw_header ${zig_folder}/lib/libc/include/any-windows-any/_mingw_mac.h)
if(EXISTS ${mingw_header} AND EXISTS ${zig_folder}/LICENSE AND OWN_LIBM AND NOT CMAKE_CROSSCOMPILING)
  set(CAN_RELEASE ON)
  # what zig puts into the libraries, and under which licenses
  execute_process(COMMAND ${ZIG} version OUTPUT_VARIABLE zig_version OUTPUT_STRIP_TRAILING_WHITESPACE)
  file(STRINGS ${mingw_header} mingw_version REGEX "define __MINGW64_VERSION_(MAJOR|MINOR|BUGFIX)")
  list(TRANSFORM mingw_version REPLACE ".* " "")
  list(JOIN mingw_version . mingw_version)
endif()

# Configured by hand like this build: what setup.sh finds by itself is found there too.
set(same_settings "")
foreach(setting Python3_EXECUTABLE FMI_HEADERS_DIR SUNDIALS_SOURCE_DIR MUSL_SOURCE_DIR OWN_LIBM)
  list(APPEND same_settings -D${setting}=${${setting}})
endforeach()

# add_platform(platform target ...): target platform_..., which builds these targets in build/platforms
function(add_platform platform)
  set(folder ${PROJECT_BINARY_DIR}/platforms/${platform})
  add_custom_target(platform_${platform}
    COMMAND ${CMAKE_COMMAND} -S ${PROJECT_SOURCE_DIR} --preset ${platform} -B ${folder} ${same_settings}
            --log-level=WARNING
    COMMAND ${CMAKE_COMMAND} -E env --unset=MAKEFLAGS
            ${CMAKE_COMMAND} --build ${folder} --target ${ARGN} --parallel 2
    COMMENT "Building for ${platform}"
    VERBATIM)
endfunction()

set(platform_targets "")
set(platform_builds "")
foreach(platform IN LISTS RELEASE_PLATFORMS)
  add_platform(${platform} libraries runtime loop)
  list(APPEND platform_targets platform_${platform})
  list(APPEND platform_builds ${PROJECT_BINARY_DIR}/platforms/${platform})
endforeach()

# suffix_of(platform result): of shared objects.
function(suffix_of platform result)
  if(platform MATCHES windows)
    set(suffix .dll)
  elseif(platform MATCHES darwin)
    set(suffix .dylib)
  else()
    set(suffix .so)
  endif()
  set(${result} ${suffix} PARENT_SCOPE)
endfunction()

# library_of(platform below name result): the shared object of an FMU for a platform.
function(library_of platform below name result)
  suffix_of(${platform} suffix)
  set(${result} ${PROJECT_BINARY_DIR}/platforms/${platform}/fmu/${name}/${below}${name}${suffix} PARENT_SCOPE)
endfunction()

# add_release_fmu(NAME version ENTRIES entry ... DEPENDS file ...): build/release/NAME.fmu, or fmi3/NAME.fmu.
# Entries are those of package.py for all but binaries, sources and the model description.
function(add_release_fmu name version)
  cmake_parse_arguments(ARG "" "" "ENTRIES;DEPENDS" ${ARGN})
  if(NOT CAN_RELEASE)
    return()
  endif()
  set(target ${name}${${version}_suffix})
  set(below ${${version}_below})

  # package.py makes one of two with the same name
  set(libraries "")
  set(binaries "")
  foreach(platform IN LISTS RELEASE_PLATFORMS)
    folder_in_fmu(${version} ${platform} folder)
    library_of(${platform} "${below}" ${name} library)
    list(APPEND libraries ${library})
    cmake_path(GET library EXTENSION suffix)
    list(APPEND binaries binaries/${folder}/${name}${suffix}=${library})
  endforeach()

  set(described ${CMAKE_CURRENT_BINARY_DIR}/fmu/${name}/${below}release)
  set(fmu ${RELEASE_FOLDER}/${below}${name}.fmu)
  add_custom_command(
    OUTPUT ${fmu}
    COMMAND ${Python3_EXECUTABLE} ${FMU_SOURCE_DIR}/package.py ${fmu}
            modelDescription.xml=${described}/modelDescription.xml
            sources=${described}/sources
            ${binaries}
            ${ARG_ENTRIES}
            documentation/licenses/zig.txt=${zig_folder}/LICENSE
            documentation/licenses/mingw-w64.txt=${zig_folder}/lib/libc/mingw/COPYING
    DEPENDS ${target}_sources ${described}/modelDescription.xml ${platform_targets} ${libraries} ${ARG_DEPENDS}
    COMMENT "Packing release/${below}${name}.fmu"
    COMMAND_EXPAND_LISTS VERBATIM)
  add_custom_target(${target}_release DEPENDS ${fmu})
  add_dependencies(${target}_release ${name}_documents)
  set_property(GLOBAL APPEND PROPERTY release_libraries ${libraries})
  set_property(GLOBAL APPEND PROPERTY release_files ${fmu})
  set_property(GLOBAL APPEND PROPERTY release_targets ${target}_release)
endfunction()

# add_release(): the target release, after all FMUs.
function(add_release)
  if(NOT CAN_RELEASE)
    add_custom_target(release
      COMMAND ${CMAKE_COMMAND} -E echo "A release needs zig with its license and headers (./setup.sh --release), and OWN_LIBM."
      COMMAND ${CMAKE_COMMAND} -E false VERBATIM)
    return()
  endif()
  get_property(files GLOBAL PROPERTY release_files)
  get_property(targets GLOBAL PROPERTY release_targets)
  set(parts
      --part SUNDIALS,${SUNDIALS_VERSION},BSD-3-Clause,https://computing.llnl.gov/projects/sundials
      --part musl,${MUSL_VERSION},MIT,https://musl.libc.org
      --part zig,${zig_version},MIT,https://ziglang.org
      --part mingw-w64,${mingw_version},ZPL-2.1,https://www.mingw-w64.org)
  # the libraries of FMUs have all that those of own equations are linked with
  get_property(libraries GLOBAL PROPERTY release_libraries)
  set(built ${RELEASE_FOLDER}/built.tar.xz)
  set(page ${PROJECT_BINARY_DIR}/playground/index.html)
  add_custom_command(
    OUTPUT ${built}
    COMMAND ${Python3_EXECUTABLE} ${FMU_SOURCE_DIR}/built.py ${platform_builds} ${PROJECT_BINARY_DIR}/platforms/wasm32-wasi
            --page ${page} --output ${built}
    DEPENDS ${platform_targets} ${libraries} playground ${page}
            ${FMU_SOURCE_DIR}/built.py ${FMU_SOURCE_DIR}/source_code.py
    COMMENT "Packing what is built for all platforms"
    VERBATIM)
  list(APPEND files ${built})

  # the loop that rparm steps FMUs by, for the wheel
  set(loops "")
  foreach(platform IN LISTS RELEASE_PLATFORMS)
    suffix_of(${platform} suffix)
    set(loop ${RELEASE_FOLDER}/loop/${platform}/loop${suffix})
    set(built_loop ${PROJECT_BINARY_DIR}/platforms/${platform}/loop/loop${suffix})
    add_custom_command(
      OUTPUT ${loop}
      COMMAND ${CMAKE_COMMAND} -E copy ${built_loop} ${loop}
      DEPENDS ${platform_targets} ${built_loop}
      VERBATIM)
    list(APPEND loops ${loop})
  endforeach()
  add_custom_target(release_files DEPENDS ${targets} ${files} ${loops})

  set(wheel ${RELEASE_FOLDER}/rparm-${PROJECT_VERSION}-py3-none-any.whl)
  file(GLOB_RECURSE packaged CONFIGURE_DEPENDS ${PROJECT_SOURCE_DIR}/rparm/* ${PROJECT_SOURCE_DIR}/models/*
       ${PROJECT_SOURCE_DIR}/fmu/*.py ${PROJECT_SOURCE_DIR}/fmu/*.toml ${PROJECT_SOURCE_DIR}/fmu/*.in ${PROJECT_SOURCE_DIR}/fmu/*.css
       ${PROJECT_SOURCE_DIR}/src/instance/*.toml)
  list(FILTER packaged EXCLUDE REGEX __pycache__)
  add_custom_command(
    OUTPUT ${wheel}
    COMMAND ${CMAKE_COMMAND} -E env RPARM_RELEASE=${RELEASE_FOLDER}
            ${Python3_EXECUTABLE} -m hatchling build -t wheel -d ${RELEASE_FOLDER}
    WORKING_DIRECTORY ${PROJECT_SOURCE_DIR}
    DEPENDS ${targets} ${files} ${loops} ${packaged} ${PROJECT_SOURCE_DIR}/pyproject.toml
            ${PROJECT_SOURCE_DIR}/README.md
    COMMENT "Packing the wheel"
    VERBATIM)
  list(APPEND files ${wheel})

  set(bill ${RELEASE_FOLDER}/sbom.cdx.json)
  add_custom_command(
    OUTPUT ${bill} ${RELEASE_FOLDER}/SHA256SUMS
    COMMAND ${Python3_EXECUTABLE} ${FMU_SOURCE_DIR}/bill_of_materials.py ${files} --output ${RELEASE_FOLDER}
            --version ${PROJECT_VERSION} --license ${PROJECT_SOURCE_DIR}/LICENSE ${parts}
            --requirements ${PROJECT_SOURCE_DIR}/requirements --project ${PROJECT_SOURCE_DIR}/pyproject.toml
    DEPENDS ${targets} ${files} ${FMU_SOURCE_DIR}/bill_of_materials.py
    COMMENT "Writing checksums and the bill of materials"
    VERBATIM)
  add_custom_target(release DEPENDS ${bill})
endfunction()
