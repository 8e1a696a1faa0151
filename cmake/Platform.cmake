# What differs between platforms, in one place: names in an FMU, and flags that harden what is delivered.

# folders of the binary in an archive of FMI 2.0 and of FMI 3.0, and how the file is called there
set(FMI2_PLATFORM linux64)
set(FMI3_PLATFORM x86_64-linux)
set(FMU_LIBRARY_SUFFIX .so)

# No path in what is delivered: two builds in two folders are the same.
set(reproducible_options
  $<$<CONFIG:Release>:-ffile-prefix-map=${PROJECT_BINARY_DIR}=build>
  $<$<CONFIG:Release>:-ffile-prefix-map=${PROJECT_SOURCE_DIR}=.>)

# Protecting the stack costs a comparison in functions with arrays; sanitizers check the stack themselves.
set(hardening_options
  -fstack-protector-strong
  $<$<CONFIG:Release>:-U_FORTIFY_SOURCE>
  $<$<CONFIG:Release>:-D_FORTIFY_SOURCE=2>)

# Of the shared object: it exports what fmi2Functions.h marks and nothing of the libraries inside it,
# leaves out what is not used of them, names all it needs, and is read-only where it can be.
set(FMU_LINK_OPTIONS
  -Wl,--exclude-libs,ALL -Wl,--gc-sections -Wl,--no-undefined -Wl,--as-needed
  -Wl,-z,relro,-z,now,-z,noexecstack,-z,text)

# Of sources that are not the project's own: they are taken as they are, and not all of
# them is used.
set(foreign_options -w -ffunction-sections -fdata-sections $<$<C_COMPILER_ID:GNU>:-fno-analyzer>)
