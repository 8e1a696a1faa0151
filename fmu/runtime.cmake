# What FMUs of own equations are linked with (build_model.py): all that is the same for every model, compiled
# once. BUILD/runtime/runtime.json says where it is and how a model is compiled and linked to it.

if(WASM)
  return() # the playground has its own models
endif()

set(runtime_versions "")
foreach(version IN LISTS FMI_VERSIONS)
  set(target runtime_${version})
  add_library(${target} OBJECT ${FMU_SHARED_SOURCES} ${${version}_SOURCES})
  target_include_directories(${target} PRIVATE ${FMU_SOURCE_DIR}/component)
  target_include_directories(${target} SYSTEM PRIVATE ${FMI_HEADERS_DIR})
  target_link_libraries(${target} PRIVATE instance)
  folder_in_fmu(${version} ${PLATFORM} folder)
  manifest_entry(${target} entry)
  list(APPEND runtime_versions "\"${version}\": {\"folder\": \"binaries/${folder}\", \"sources\": ${entry},
\"objects\": [\"$<JOIN:$<TARGET_OBJECTS:${target}>,\"$<COMMA> \">\"]}")
endforeach()
list(JOIN runtime_versions ",\n" runtime_versions)

# what it links to, each library behind those that use it
set(linked "")
libraries_in(runtime_fmi2 linked)
set(runtime_libraries "")
set(runtime_sources "")
foreach(library IN LISTS linked)
  get_target_property(type ${library} TYPE)
  if(type STREQUAL "STATIC_LIBRARY")
    manifest_entry(${library} entry)
    list(APPEND runtime_sources "${entry}")
  endif()
  if(type STREQUAL "STATIC_LIBRARY" AND NOT library STREQUAL "elementary_functions")
    list(APPEND runtime_libraries "\"$<TARGET_FILE:${library}>\"")
  endif()
endforeach()
list(JOIN runtime_libraries ", " runtime_libraries)
list(JOIN runtime_sources ",\n" runtime_sources)
list(JOIN FMU_LINK_OPTIONS "\", \"" link_options)
set(elementary "")
set(licenses "\"license.txt\": \"${PROJECT_SOURCE_DIR}/LICENSE\", \"sundials.txt\": \"${SUNDIALS_LICENSE}\"")
if(OWN_LIBM)
  set(elementary "$<TARGET_OBJECTS:elementary_functions>")
  string(APPEND licenses ", \"musl.txt\": \"${MUSL_LICENSE}\"")
endif()

separate_arguments(flags UNIX_COMMAND "${CMAKE_C_FLAGS} ${CMAKE_C_FLAGS_RELEASE}")
set(compile ${flags} -std=c17 ${CMAKE_C_COMPILE_OPTIONS_PIC} -fvisibility=hidden)
set(include "$<TARGET_PROPERTY:runtime_fmi2,INCLUDE_DIRECTORIES>")
file(GENERATE OUTPUT ${PROJECT_BINARY_DIR}/runtime/runtime.json CONTENT "{
\"version\": \"${PROJECT_VERSION}\",
\"compiler\": \"${CMAKE_C_COMPILER}\",
\"options\": [\"$<JOIN:${compile};$<TARGET_PROPERTY:runtime_fmi2,COMPILE_OPTIONS>,\"$<COMMA> \">\"],
\"include\": [\"$<JOIN:${include},\"$<COMMA> \">\"],
\"versions\": {${runtime_versions}},
\"libraries\": [${runtime_libraries}],
\"elementary\": [\"$<JOIN:${elementary},\"$<COMMA> \">\"],
\"link\": [\"${link_options}\"],
\"sources\": [${runtime_sources}],
\"roots\": {\"project\": \"${PROJECT_SOURCE_DIR}\", \"generated\": \"${PROJECT_BINARY_DIR}\",
\"fmi\": \"${FMI_HEADERS_DIR}\", \"sundials\": \"${SUNDIALS_SOURCE_DIR}\", \"musl\": \"${MUSL_SOURCE_DIR}\"},
\"suffix\": \"${FMU_LIBRARY_SUFFIX}\",
\"licenses\": {${licenses}}
}
")
add_custom_target(runtime ALL DEPENDS runtime_fmi2 runtime_fmi3)
