# With what cargo is called for the compiler that the tests are configured with, that it is not looked for where the
# library is built already, and what is refused. A script stands in for cargo, and one for rustc. COMPILERS are the
# options that name the compiler, TRIPLE is the target that they are for, CROSS says whether that is another one than
# this machine's, and COMPILER then links.

cmake_minimum_required(VERSION 3.16)
set(folder "${SCRATCH}/cargo")
file(REMOVE_RECURSE "${folder}")
include("${SOURCE}/bindings/cmake/VrtmNames.cmake")
vrtm_names(${TRIPLE} 0.0.0)

# script(NAME TEXT): a program for the shell.
function(script name text)
  file(WRITE "${folder}/new/${name}" "#!/bin/sh\n${text}\n")
  file(COPY "${folder}/new/${name}" DESTINATION "${folder}/bin"
    FILE_PERMISSIONS OWNER_READ OWNER_WRITE OWNER_EXECUTE)
endfunction()

# configure(VARIABLE BUILD OPTION...): what cmake says, with its exit code in `code`.
function(configure variable build)
  execute_process(COMMAND "${CMAKE_COMMAND}" -S "${SOURCE}" -B "${folder}/${build}" ${ARGN} RESULT_VARIABLE code
    OUTPUT_QUIET ERROR_VARIABLE said)
  # Messages are broken into lines.
  string(REGEX REPLACE "[ \n]+" " " said "${said}")
  set(${variable} "${said}" PARENT_SCOPE)
  set(code ${code} PARENT_SCOPE)
endfunction()

# Rust is this machine's, and has a standard library for all. It may be the compiler's own target, and another.
set(host x86_64-unknown-linux-gnu)
if(NOT CROSS)
  set(host ${TRIPLE})
endif()
script(rustc "case $1 in -vV) echo 'host: ${host}' ;; --print) echo '${folder}' ;; esac")
script(cargo "env >'${folder}/environment'
echo \"$@\" >'${folder}/arguments'
for made in '${folder}/target/dist' '${folder}/target/${TRIPLE}/dist'; do
    mkdir -p \"$made\"
    for file in ${VRTM_BUILT} ${VRTM_BUILT_IMPORT}; do echo made >\"$made/$file\"; done
done")
configure(said built ${COMPILERS} "-DVRTM_CARGO=${folder}/bin/cargo" "-DVRTM_RUSTC=${folder}/bin/rustc"
  "-DVRTM_CARGO_TARGET_DIR=${folder}/target")
if(code)
  message(FATAL_ERROR "it is not configured: ${said}")
endif()
execute_process(COMMAND "${CMAKE_COMMAND}" --build "${folder}/built" RESULT_VARIABLE failed OUTPUT_QUIET)
if(failed OR NOT EXISTS "${folder}/built/lib/${VRTM_BUILT}")
  message(FATAL_ERROR "it is not built")
endif()
file(READ "${folder}/arguments" arguments)
file(READ "${folder}/environment" environment)
string(TOUPPER "CARGO_TARGET_${TRIPLE}_LINKER" linker)
string(REPLACE "-" "_" linker "${linker}")
if(CROSS)
  if(NOT arguments MATCHES "--target ${TRIPLE}")
    message(FATAL_ERROR "cargo is to build for ${TRIPLE}, but is called with ${arguments}")
  endif()
  string(FIND "${environment}" "\n${linker}=${COMPILER}\n" at)
  if(at EQUAL -1)
    message(FATAL_ERROR "${linker} is not ${COMPILER}")
  endif()
elseif(arguments MATCHES "--target ")
  message(FATAL_ERROR "cargo builds for this machine anyway, but is called with ${arguments}")
endif()
if(NOT arguments MATCHES "--remap-path-prefix=${SOURCE}=/vrtm'.*=/cargo'")
  message(FATAL_ERROR "the library would hold paths of this machine: cargo is called with ${arguments}")
endif()
# The option wins over all that is known.
configure(said named ${COMPILERS} "-DVRTM_CARGO=${folder}/bin/cargo" "-DVRTM_RUSTC=${folder}/bin/rustc"
  "-DVRTM_CARGO_TARGET_DIR=${folder}/target" -DVRTM_TARGET=powerpc64le-unknown-linux-gnu)
execute_process(COMMAND "${CMAKE_COMMAND}" --build "${folder}/named" OUTPUT_QUIET ERROR_QUIET)
file(READ "${folder}/arguments" arguments)
if(code OR NOT arguments MATCHES "--target powerpc64le-unknown-linux-gnu")
  message(FATAL_ERROR "VRTM_TARGET is not handed on: ${arguments} ${said}")
endif()

# A library that is built already: neither cargo nor rustc is called, wherever they might be.
set(library "${folder}/prebuilt/${VRTM_BUILT}")
foreach(file ${VRTM_BUILT} ${VRTM_BUILT_IMPORT})
  file(WRITE "${folder}/prebuilt/${file}" "built already")
endforeach()
foreach(program cargo rustc)
  script(${program} "echo called >>'${folder}/called'; exit 1")
endforeach()
set(path "$ENV{PATH}")
set(home "$ENV{HOME}")
set(ENV{PATH} "${folder}/bin:${path}")
set(ENV{CARGO_HOME} "${folder}")
set(ENV{HOME} "${folder}")
configure(said prebuilt ${COMPILERS} "-DVRTM_PREBUILT=${library}")
execute_process(COMMAND "${CMAKE_COMMAND}" --install "${folder}/prebuilt" --prefix "${folder}/prefix"
  RESULT_VARIABLE failed OUTPUT_QUIET)
set(target)
if(CROSS)
  set(target --target ${TRIPLE})
endif()
execute_process(COMMAND "${SH}" "${SOURCE}/bindings/install.sh" --prefix "${folder}/script" --prebuilt "${library}" ${target}
  RESULT_VARIABLE script_failed OUTPUT_QUIET)
set(ENV{PATH} "${path}")
set(ENV{HOME} "${home}")
unset(ENV{CARGO_HOME})
file(GLOB_RECURSE installed "${folder}/prefix/*/${VRTM_BUILT}")
file(GLOB_RECURSE also "${folder}/script/*/${VRTM_BUILT}")
if(code OR failed OR script_failed OR NOT installed OR NOT also OR EXISTS "${folder}/called")
  message(FATAL_ERROR "a library that is built already is not installed without Rust: ${said}")
endif()

# refuses(TEXT OPTION...): the configuration fails, and says TEXT.
function(refuses text)
  file(REMOVE_RECURSE "${folder}/refused")
  configure(said refused ${ARGN})
  if(NOT code OR NOT said MATCHES "${text}")
    message(FATAL_ERROR "${ARGN} is not refused for \"${text}\": ${code} ${said}")
  endif()
endfunction()
refuses("VRTM_PREBUILT is [^ ]*none, which does not exist" "-DVRTM_PREBUILT=${folder}/none")
refuses("a library for x86_64-apple-darwin is called libvrtm.dylib: set VRTM_TARGET" "-DVRTM_PREBUILT=${library}"
  -DVRTM_TARGET=x86_64-apple-darwin)
file(WRITE "${folder}/alone/vrtm.dll" "")
refuses("its import library libvrtm.dll.a is not beside it" "-DVRTM_PREBUILT=${folder}/alone/vrtm.dll"
  -DVRTM_TARGET=x86_64-pc-windows-gnu)
refuses("the system \"Generic\" is none that is known here. Set VRTM_TARGET, such as" "-DVRTM_PREBUILT=${library}"
  -DCMAKE_SYSTEM_NAME=Generic -DCMAKE_SYSTEM_PROCESSOR=x86_64)
execute_process(COMMAND "${SH}" "${SOURCE}/bindings/install.sh" --prefix "${folder}/script" --prebuilt "${library}"
  --target x86_64-apple-darwin RESULT_VARIABLE code OUTPUT_QUIET ERROR_VARIABLE said)
if(NOT code OR NOT said MATCHES "but a library for x86_64-apple-darwin is called libvrtm.dylib")
  message(FATAL_ERROR "install.sh does not refuse a library for another system: ${said}")
endif()
