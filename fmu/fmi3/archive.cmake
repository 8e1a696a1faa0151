# add_fmi3_archive(NAME folder): packs fmi3/NAME.fmu in the current build folder from what add_fmu has
# generated in the folder. Target: NAME_fmi3_fmu.
function(add_fmi3_archive name out)
  set(fmu ${CMAKE_CURRENT_BINARY_DIR}/fmi3/${name}.fmu)
  file(MAKE_DIRECTORY ${CMAKE_CURRENT_BINARY_DIR}/fmi3)
  add_custom_command(
    OUTPUT ${fmu}
    COMMAND ${Python3_EXECUTABLE} ${FMU_SOURCE_DIR}/package.py ${fmu}
            modelDescription.xml=${out}/fmi3/modelDescription.xml
            binaries/${FMI3_PLATFORM}/${name}${FMU_LIBRARY_SUFFIX}=$<TARGET_FILE:${name}_fmi3>
            documentation=${out}/documentation
            documentation/licenses/license.txt=${PROJECT_SOURCE_DIR}/LICENSE
            documentation/licenses/sundials.txt=${SUNDIALS_LICENSE}
            $<$<BOOL:${OWN_LIBM}>:documentation/licenses/musl.txt=${MUSL_LICENSE}>
    DEPENDS ${name}_fmi3 ${out}/fmi3/modelDescription.xml ${out}/documentation/index.html
            ${PROJECT_SOURCE_DIR}/LICENSE ${FMU_SOURCE_DIR}/package.py
            ${FMU_SOURCE_DIR}/atomic_write.py
    COMMENT "Packing fmi3/${name}.fmu"
    COMMAND_EXPAND_LISTS VERBATIM)
  add_custom_target(${name}_fmi3_fmu ALL DEPENDS ${fmu})
endfunction()
