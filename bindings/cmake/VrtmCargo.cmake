# Drives cargo: the target `vrtm_build` builds the library and puts it, named as it is installed, into a folder of the
# build tree, from where projects that take vrtm as a subfolder link and run it.

# vrtm_check_prebuilt(): whether VRTM_PREBUILT is there, with its import library, and is for the system that it is used on.
function(vrtm_check_prebuilt)
  # It is copied in another folder than this. One on the command line is absolute by now.
  get_filename_component(VRTM_PREBUILT "${VRTM_PREBUILT}" ABSOLUTE BASE_DIR "${CMAKE_SOURCE_DIR}")
  set(VRTM_PREBUILT "${VRTM_PREBUILT}" PARENT_SCOPE)
  if(NOT EXISTS "${VRTM_PREBUILT}" OR IS_DIRECTORY "${VRTM_PREBUILT}")
    message(FATAL_ERROR "vrtm: VRTM_PREBUILT is ${VRTM_PREBUILT}, which does not exist")
  endif()
  string(REGEX MATCH "\\.[a-z]+$" ending "${VRTM_BUILT}")
  string(REPLACE "." "\\." ending "${ending}")
  if(NOT VRTM_PREBUILT MATCHES "${ending}(\\.[0-9.]+)?$")
    message(FATAL_ERROR "vrtm: VRTM_PREBUILT is ${VRTM_PREBUILT}, but a library for ${vrtm_triple} is called ${VRTM_BUILT}: "
      "set VRTM_TARGET if it is for another target")
  endif()
  get_filename_component(folder "${VRTM_PREBUILT}" DIRECTORY)
  if(VRTM_BUILT_IMPORT AND NOT EXISTS "${folder}/${VRTM_BUILT_IMPORT}")
    message(FATAL_ERROR "vrtm: VRTM_PREBUILT is ${VRTM_PREBUILT}, but its import library ${VRTM_BUILT_IMPORT} is not beside it")
  endif()
endfunction()

# vrtm_check_standard_library(): warns where rustc has none for another target, which cargo says at great length.
function(vrtm_check_standard_library)
  if(VRTM_TARGET AND NOT DEFINED ENV{CARGO_UNSTABLE_BUILD_STD})
    execute_process(COMMAND "${VRTM_RUSTC}" --print target-libdir --target ${VRTM_TARGET} OUTPUT_VARIABLE libraries
      RESULT_VARIABLE failed OUTPUT_STRIP_TRAILING_WHITESPACE ERROR_QUIET)
    if(failed)
      message(FATAL_ERROR "vrtm: ${VRTM_RUSTC} knows no target ${VRTM_TARGET}: set VRTM_TARGET; `rustc --print target-list` "
        "lists all")
    elseif(NOT EXISTS "${libraries}")
      message(WARNING "vrtm: ${VRTM_RUSTC} has no standard library for ${VRTM_TARGET}: rustup target add ${VRTM_TARGET}")
    endif()
  endif()
endfunction()

# vrtm_cargo_environment(VARIABLE): with what cargo is called: for another target, the C compiler links.
function(vrtm_cargo_environment variable)
  set(environment "RUSTC=${VRTM_RUSTC}")
  if(VRTM_TARGET AND CMAKE_CROSSCOMPILING AND CMAKE_C_COMPILER_ID MATCHES "GNU|Clang" AND NOT CMAKE_C_COMPILER_TARGET)
    string(TOUPPER "CARGO_TARGET_${VRTM_TARGET}_LINKER" linker)
    string(REGEX REPLACE "[-.]" "_" linker "${linker}")
    if(NOT DEFINED ENV{${linker}})
      list(APPEND environment "${linker}=${CMAKE_C_COMPILER}")
    endif()
  endif()
  set(${variable} "${environment}" PARENT_SCOPE)
endfunction()

# vrtm_cargo_arguments(VARIABLE): what cargo build is called with, by the options in CMakeLists.txt.
function(vrtm_cargo_arguments variable)
  set(arguments build --manifest-path "${vrtm_SOURCE_DIR}/Cargo.toml" --package vrtm-c
    --profile ${VRTM_PROFILE} --target-dir "${VRTM_CARGO_TARGET_DIR}")
  if(NOT VRTM_GPU)
    list(APPEND arguments --no-default-features)
  endif()
  if(VRTM_FEATURES)
    list(APPEND arguments --features "${VRTM_FEATURES}")
  endif()
  if(VRTM_OFFLINE)
    list(APPEND arguments --offline --locked)
  endif()
  if(VRTM_TARGET)
    list(APPEND arguments --target ${VRTM_TARGET})
  endif()
  set(${variable} ${arguments} PARENT_SCOPE)
endfunction()

# vrtm_cargo_folder(VARIABLE): where cargo leaves the library.
function(vrtm_cargo_folder variable)
  set(folder "${VRTM_CARGO_TARGET_DIR}")
  if(VRTM_TARGET)
    string(APPEND folder "/${VRTM_TARGET}")
  endif()
  if(VRTM_PROFILE STREQUAL "dev")
    string(APPEND folder "/debug")
  else()
    string(APPEND folder "/${VRTM_PROFILE}")
  endif()
  set(${variable} "${folder}" PARENT_SCOPE)
endfunction()

# vrtm_add_build(FOLDER): adds the target `vrtm_build`, which fills FOLDER. With VRTM_PREBUILT it copies that file.
function(vrtm_add_build folder)
  if(VRTM_PREBUILT)
    set(cargo)
    set(says "vrtm: copies ${VRTM_PREBUILT}, which is built already")
    set(library "${VRTM_PREBUILT}")
    get_filename_component(from "${VRTM_PREBUILT}" DIRECTORY)
  else()
    vrtm_cargo_arguments(arguments)
    vrtm_cargo_folder(from)
    vrtm_cargo_environment(environment)
    set(cargo COMMAND "${CMAKE_COMMAND}" -E env ${environment} "${VRTM_CARGO}" ${arguments})
    set(says "vrtm: cargo builds the library")
    set(library "${from}/${VRTM_BUILT}")
  endif()
  set(copies COMMAND "${CMAKE_COMMAND}" -E copy_if_different "${library}" "${folder}/${VRTM_FILE}")
  set(made "${folder}/${VRTM_FILE}")
  foreach(link IN LISTS VRTM_LINKS)
    list(APPEND copies COMMAND "${CMAKE_COMMAND}" -E create_symlink ${VRTM_FILE} "${folder}/${link}")
  endforeach()
  if(VRTM_FILE_IMPORT)
    list(APPEND copies COMMAND "${CMAKE_COMMAND}" -E copy_if_different
      "${from}/${VRTM_BUILT_IMPORT}" "${folder}/${VRTM_FILE_IMPORT}")
    list(APPEND made "${folder}/${VRTM_FILE_IMPORT}")
  endif()
  set(all)
  if(VRTM_INSTALL OR PROJECT_IS_TOP_LEVEL)
    set(all ALL)
  endif()
  # Cargo itself finds out what is to be built anew, so it is called every time.
  add_custom_target(vrtm_build ${all} ${cargo}
    COMMAND "${CMAKE_COMMAND}" -E make_directory "${folder}" ${copies}
    BYPRODUCTS ${made} COMMENT "${says}" USES_TERMINAL VERBATIM)
endfunction()
