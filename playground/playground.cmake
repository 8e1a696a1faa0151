# Target playground: build/playground/index.html, one page with two FMUs as WebAssembly in it, and FMUs to drop on it:
# build/platforms/wasm32-wasi/NAME.fmu, target web of the preset wasm32-wasi. That has the runtime of rparm build --web, too.

if(WASM)
  get_property(names DIRECTORY ${PROJECT_SOURCE_DIR} PROPERTY FMUS)
  list(TRANSFORM names APPEND _fmu)
  add_custom_target(web DEPENDS runtime)
  add_dependencies(web ${names})
endif()

set(fmus RPPlant RPController)
set(page ${PROJECT_BINARY_DIR}/playground/index.html)

if(NOT CAN_RELEASE)
  add_custom_target(playground
    COMMAND ${CMAKE_COMMAND} -E echo "The playground needs the tools of a release: ./setup.sh --release"
    COMMAND ${CMAKE_COMMAND} -E false VERBATIM)
  return()
endif()

add_platform(wasm32-wasi web)
set(modules "")
foreach(name IN LISTS fmus)
  list(APPEND modules ${PROJECT_BINARY_DIR}/platforms/wasm32-wasi/fmu/${name}/${name}.wasm)
endforeach()
set(wasi ${zig_folder}/lib/libc/wasi)
set(licenses
    --license project=${PROJECT_SOURCE_DIR}/LICENSE
    --license SUNDIALS=${SUNDIALS_LICENSE}
    --license musl=${MUSL_LICENSE}
    --license zig=${zig_folder}/LICENSE
    --license wasi-libc=${wasi}/LICENSE
    --license wasi-libc=${wasi}/LICENSE-MIT
    --license cloudlibc=${wasi}/libc-bottom-half/cloudlibc/LICENSE)
# not by the files' times: the other build is the one that knows whether anything has changed
add_custom_target(playground
  COMMAND ${Python3_EXECUTABLE} ${CMAKE_CURRENT_LIST_DIR}/build.py ${modules} ${licenses} --output ${page}
  COMMENT "Writing playground/index.html"
  VERBATIM)
add_dependencies(playground platform_wasm32-wasi)
