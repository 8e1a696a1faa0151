# Target sundials: what the integrator needs of SUNDIALS, compiled with the flags of the project. No
# object of it exports a symbol, and it allocates from the workspace of an instance.

set(SUNDIALS_VERSION 6.4.1)
file(STRINGS ${SUNDIALS_SOURCE_DIR}/CMakeLists.txt version REGEX "^set\\(PACKAGE_VERSION_(MAJOR|MINOR|PATCH) ")
string(REGEX MATCHALL "[0-9]+" version "${version}")
list(JOIN version . version)
if(NOT version STREQUAL SUNDIALS_VERSION)
  message(FATAL_ERROR "${SUNDIALS_SOURCE_DIR} has SUNDIALS '${version}', not ${SUNDIALS_VERSION}")
endif()
set(SUNDIALS_LICENSE ${SUNDIALS_SOURCE_DIR}/LICENSE)

set(sundials_include ${PROJECT_BINARY_DIR}/sundials)
foreach(header config export)
  configure_file(${CMAKE_CURRENT_LIST_DIR}/sundials_${header}.h.in
                 ${sundials_include}/sundials/sundials_${header}.h @ONLY)
endforeach()

set(files
  arkode/arkode arkode/arkode_adapt arkode/arkode_butcher arkode/arkode_butcher_erk arkode/arkode_erkstep
  arkode/arkode_erkstep_io arkode/arkode_interp arkode/arkode_io arkode/arkode_root
  cvode/cvode cvode/cvode_io cvode/cvode_ls cvode/cvode_nls cvode/cvode_proj
  nvector/serial/nvector_serial
  sundials/sundials_context sundials/sundials_band
  sundials/sundials_dense sundials/sundials_linearsolver
  sundials/sundials_logger sundials/sundials_math sundials/sundials_matrix
  sundials/sundials_nonlinearsolver sundials/sundials_nvector sundials/sundials_nvector_senswrapper
  sunlinsol/band/sunlinsol_band sunlinsol/dense/sunlinsol_dense sunmatrix/band/sunmatrix_band sunmatrix/dense/sunmatrix_dense
  sunnonlinsol/fixedpoint/sunnonlinsol_fixedpoint sunnonlinsol/newton/sunnonlinsol_newton)
list(TRANSFORM files PREPEND ${SUNDIALS_SOURCE_DIR}/src/)
list(TRANSFORM files APPEND .c)

add_library(sundials STATIC ${files})
target_include_directories(sundials
  SYSTEM PUBLIC ${sundials_include} ${SUNDIALS_SOURCE_DIR}/include
  PRIVATE ${SUNDIALS_SOURCE_DIR}/src/sundials)
target_link_libraries(sundials PUBLIC workspace elementary_functions)
target_compile_options(sundials PRIVATE
  ${foreign_options} $<$<CONFIG:Release>:-ffile-prefix-map=${SUNDIALS_SOURCE_DIR}=sundials>
  "SHELL:-include \"${PROJECT_SOURCE_DIR}/src/integrator/sundials_allocation.h\"")
