# What FMUs of own equations are linked with: all that is the same for every model, compiled once.
# BUILD/runtime/runtime.json says where it is and how a model is compiled and linked to it: building.py.

set(runtime_versions "")
foreach(version IN LISTS FMI_VERSIONS)
  set(target runtime_${version})
  add_library(${target} OBJECT ${FMU_SHARED_SOURCES} ${${version}_SOURCES})
  target_include_directories(${target} PRIVATE ${FMU_SOURCE_DIR}/fmi)
  target_include_directories(${target} SYSTEM PRIVATE ${FMI_HEADERS_DIR})
  target_link_libraries(${target} PRIVATE instance contacts gradients relations)
  folder_in_fmu(${version} ${PLATFORM} folder)
  manifest_entry(${target} entry)
  list(APPEND runtime_versions "\"${version}\": {\"folder\": \"binaries/${folder}\", \"sources\": ${entry},
\"objects\": [\"$<JOIN:$<TARGET_OBJECTS:${target}>,\"$<COMMA> \">\"]}")
endforeach()
list(JOIN runtime_versions ",\n" runtime_versions)

# what it links to, each library behind those that use it; the elementary functions as objects, as FMUs do
set(linked "")
libraries_in(runtime_fmi2 linked)
set(runtime_libraries "")
set(runtime_sources "")
foreach(library IN LISTS linked)
  get_target_property(type ${library} TYPE)
  if(type STREQUAL "STATIC_LIBRARY")
    manifest_entry(${library} entry)
    list(APPEND runtime_sources "${entry}")
    if(NOT library STREQUAL "elementary_functions")
      list(APPEND runtime_libraries $<TARGET_FILE:${library}>)
    endif()
  endif()
endforeach()
list(JOIN runtime_sources ",\n" runtime_sources)
set(licenses "\"license.txt\": \"${PROJECT_SOURCE_DIR}/LICENSE\", \"sundials.txt\": \"${SUNDIALS_LICENSE}\"")
if(OWN_LIBM)
  list(PREPEND runtime_libraries $<TARGET_OBJECTS:elementary_functions>)
  string(APPEND licenses ", \"musl.txt\": \"${MUSL_LICENSE}\"")
endif()
if(ZIG_TARGET)
  string(APPEND licenses ", \"zig.txt\": \"${zig_folder}/LICENSE\"")
  if(WASM)
    set(wasi ${zig_folder}/lib/libc/wasi)
    string(APPEND licenses ", \"wasi-libc.txt\": \"${wasi}/LICENSE-MIT\"")
    string(APPEND licenses ", \"cloudlibc.txt\": \"${wasi}/libc-bottom-half/cloudlibc/LICENSE\"")
  else()
    string(APPEND licenses ", \"mingw-w64.txt\": \"${zig_folder}/lib/libc/mingw/COPYING\"")
  endif()
endif()

# CMake keeps the first word of a compiler and its other words apart; @NAME@ stands for the name of the FMU
separate_arguments(compiler UNIX_COMMAND "${CMAKE_C_COMPILER} ${CMAKE_C_COMPILER_ARG1}")
separate_arguments(flags UNIX_COMMAND "${CMAKE_C_FLAGS} ${CMAKE_C_FLAGS_RELEASE}")
set(compile ${flags} -std=c17 -fvisibility=hidden)
set(long "") # behind the others for long files: as fast as by -O3, which takes gcc twice as long
if(CMAKE_C_COMPILER_ID STREQUAL "GNU")
  set(long -O2 -ftree-vectorize -fvect-cost-model=dynamic)
endif()
set(shared ${CMAKE_SHARED_LIBRARY_CREATE_C_FLAGS})
if(NOT WASM)
  list(APPEND compile ${CMAKE_C_COMPILE_OPTIONS_PIC})
  set(shared -shared)
elseif(OWN_LIBM)
  list(APPEND compile -include ${PROJECT_BINARY_DIR}/musl/names.h) # of the elementary functions
endif()
separate_arguments(link UNIX_COMMAND "${CMAKE_SHARED_LINKER_FLAGS}")
list(APPEND link ${FMU_LINK_OPTIONS} ${shared}) # -static behind it would ask zig for an archive
if(APPLE)
  list(APPEND link -install_name @rpath/@NAME@${FMU_LIBRARY_SUFFIX})
endif()
list(JOIN link "\", \"" link)
set(include "$<TARGET_PROPERTY:runtime_fmi2,INCLUDE_DIRECTORIES>")
file(GENERATE OUTPUT ${PROJECT_BINARY_DIR}/runtime/runtime.json CONTENT "{
\"version\": \"${PROJECT_VERSION}\",
\"platform\": \"${PLATFORM}\",
\"compiler\": [\"$<JOIN:${compiler},\"$<COMMA> \">\"],
\"options\": [\"$<JOIN:${compile};$<FILTER:$<TARGET_PROPERTY:runtime_fmi2,COMPILE_OPTIONS>,EXCLUDE,^SHELL:>,\"$<COMMA> \">\"],
\"long\": [\"$<JOIN:${long},\"$<COMMA> \">\"],
\"include\": [\"$<JOIN:${include},\"$<COMMA> \">\"],
\"versions\": {${runtime_versions}},
\"libraries\": [\"$<JOIN:${runtime_libraries},\"$<COMMA> \">\"],
\"link\": [\"${link}\"],
\"sources\": [${runtime_sources}],
\"roots\": {\"project\": \"${PROJECT_SOURCE_DIR}\", \"generated\": \"${PROJECT_BINARY_DIR}\",
\"fmi\": \"${FMI_HEADERS_DIR}\", \"sundials\": \"${SUNDIALS_SOURCE_DIR}\", \"musl\": \"${MUSL_SOURCE_DIR}\",
\"zig\": \"${zig_folder}\"},
\"suffix\": \"${FMU_LIBRARY_SUFFIX}\",
\"licenses\": {${licenses}}
}
")
add_custom_target(runtime ALL DEPENDS runtime_fmi2 runtime_fmi3)
