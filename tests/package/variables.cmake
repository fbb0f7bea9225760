# All variables that a parent project sets before it takes vrtm as a subfolder are heard, whether as normal variables or in
# the cache, under old and new policies, and at the second configuration as at the first. A script stands in for cargo, and
# one for rustc. COMPILERS are the options that name the compiler, SOURCE is the repository.

cmake_minimum_required(VERSION 3.16)
set(folder "${SCRATCH}/variables")
file(REMOVE_RECURSE "${folder}")
foreach(program cargo rustc)
  file(WRITE "${folder}/new/${program}" "#!/bin/sh\necho \"$@\" >>'${folder}/${program}.called'
case $1 in --print) echo '${folder}' ;; -vV) echo 'host: x86_64-unknown-linux-gnu' ;; esac\n")
  file(COPY "${folder}/new/${program}" DESTINATION "${folder}/bin"
    FILE_PERMISSIONS OWNER_READ OWNER_WRITE OWNER_EXECUTE)
endforeach()
# Found where nothing says which to take.
set(ENV{PATH} "${folder}/bin:$ENV{PATH}")
set(target powerpc64le-unknown-linux-gnu)
file(WRITE "${folder}/made/${target}/release/libvrtm.so" "made")
file(WRITE "${folder}/libvrtm.so" "built already")

# build(VARIABLE POLICIES WAY SETTING...): configures the parent twice and builds; what is said then, and `called`, cargo's
# arguments.
function(build variable policies way)
  list(JOIN ARGN "|" settings)
  file(REMOVE_RECURSE "${folder}/build")
  file(REMOVE "${folder}/cargo.called" "${folder}/rustc.called")
  # Nothing is compiled, and the target is given, so that the compiler need not be looked at.
  set(configure "${CMAKE_COMMAND}" -S "${SOURCE}/tests/package/parent" -B "${folder}/build" ${COMPILERS}
    -DCMAKE_C_COMPILER_FORCED=TRUE "-DVRTM_SOURCE=${SOURCE}" "-DPOLICIES=${policies}" "-DWAY=${way}" "-DSETTINGS=${settings}")
  foreach(step "${configure}" "${configure}" "${CMAKE_COMMAND};--build;${folder}/build;--target;vrtm_build")
    execute_process(COMMAND ${step} RESULT_VARIABLE failed OUTPUT_VARIABLE said ERROR_VARIABLE warned)
    if(failed)
      message(FATAL_ERROR "${policies}, ${way}: ${failed}\n${said}\n${warned}")
    endif()
  endforeach()
  set(${variable} "${said}" PARENT_SCOPE)
  set(called "")
  if(EXISTS "${folder}/cargo.called")
    file(READ "${folder}/cargo.called" called)
  endif()
  set(called "${called}" PARENT_SCOPE)
endfunction()

foreach(policies 3.16 3.16...${CMAKE_VERSION})
  foreach(way normal cache fetch)
    set(case "cmake_minimum_required(VERSION ${policies}), ${way}")
    build(said ${policies} ${way} VRTM_PROFILE=release VRTM_GPU=OFF VRTM_OFFLINE=ON VRTM_FEATURES=one,two
      VRTM_TARGET=${target} "VRTM_CARGO_TARGET_DIR=${folder}/made" "VRTM_CARGO=${folder}/bin/cargo"
      "VRTM_RUSTC=${folder}/bin/rustc")
    foreach(part "--profile release" "--no-default-features" "--offline --locked" "--features one,two" "--target ${target}"
        "--target-dir ${folder}/made")
      if(NOT "${called} " MATCHES "${part}[ \n]")
        message(SEND_ERROR "${case}: cargo is called without ${part}: ${called}")
      endif()
    endforeach()
    if(NOT said MATCHES "cargo builds the library")
      message(SEND_ERROR "${case}: it is not said that cargo builds: ${said}")
    endif()

    set(library "${folder}/libvrtm.so")
    if(way STREQUAL "normal")
      # A path is relative to the parent, as in all of CMake.
      file(RELATIVE_PATH library "${SOURCE}/tests/package/parent" "${library}")
    endif()
    build(said ${policies} ${way} "VRTM_PREBUILT=${library}" VRTM_TARGET=${target})
    file(GLOB copies "${folder}/build/*/lib/libvrtm.so" "${folder}/build/_deps/*/lib/libvrtm.so")
    if(NOT copies OR called OR EXISTS "${folder}/rustc.called")
      message(SEND_ERROR "${case}: VRTM_PREBUILT=${library} is not heard: copied to \"${copies}\", cargo ${called}")
    endif()
    if(said MATCHES "cargo" OR NOT said MATCHES "copies .*libvrtm.so, which is built already")
      message(SEND_ERROR "${case}: with VRTM_PREBUILT it is said: ${said}")
    endif()
  endforeach()
endforeach()
