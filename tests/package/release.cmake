# Writes the archive of a release twice, and looks at what is in it. PREFIX has what `cmake --install` installs. TRIPLE is the
# target of a LIBRARY that is not for this machine.

set(folder "${SCRATCH}/release")
file(REMOVE_RECURSE "${folder}")
set(options --prebuilt "${LIBRARY}")
if(NOT GPU)
  list(APPEND options --no-gpu)
endif()
if(TRIPLE)
  list(APPEND options --target ${TRIPLE})
endif()

# release(OUT OPTION...): writes an archive to OUT.
function(release out)
  execute_process(COMMAND "${SH}" "${SOURCE}/bindings/release.sh" --out "${out}" ${options} ${ARGN}
    RESULT_VARIABLE failed OUTPUT_QUIET)
  if(failed)
    message(FATAL_ERROR "release.sh: ${failed}")
  endif()
endfunction()

# The name of a file is compared, too: it is the same in both folders.
release("${folder}/one")
execute_process(COMMAND "${CMAKE_COMMAND}" -E sleep 2)
release("${folder}/other")
file(GLOB archive RELATIVE "${folder}/one" "${folder}/one/vrtm-*.tar.xz" "${folder}/one/vrtm-*.zip")
if((NOT archive MATCHES "-${TRIPLE}[^/;]*$") OR (TRIPLE MATCHES "-windows-" AND NOT archive MATCHES "zip$"))
  message(FATAL_ERROR "the archive for ${TRIPLE} is called ${archive}")
endif()
file(SHA256 "${folder}/one/${archive}" one)
file(SHA256 "${folder}/other/${archive}" other)
if(NOT one STREQUAL other)
  message(FATAL_ERROR "two runs give different archives")
endif()
file(READ "${folder}/one/${archive}.sha256" sum)
if(NOT sum STREQUAL "${one}  ${archive}\n")
  message(FATAL_ERROR "the file with the sum says ${sum}, not ${one}")
endif()

execute_process(COMMAND "${CMAKE_COMMAND}" -E tar xf "${folder}/one/${archive}" WORKING_DIRECTORY "${folder}"
  RESULT_VARIABLE failed)
string(REGEX REPLACE "\\.(tar\\.xz|zip)$" "" name "${archive}")
file(GLOB_RECURSE packed RELATIVE "${folder}/${name}" LIST_DIRECTORIES FALSE "${folder}/${name}/*")
file(GLOB_RECURSE installed RELATIVE "${PREFIX}" LIST_DIRECTORIES FALSE "${PREFIX}/*")
list(SORT installed)
list(SORT packed)
if(failed OR NOT packed STREQUAL installed)
  message(FATAL_ERROR "the archive has\n  ${packed}\nand not\n  ${installed}")
endif()

file(READ "${folder}/${name}/share/doc/vrtm/THIRD-PARTY.txt" notices)
foreach(crate glam half fearless_simd xxhash-rust libc)
  if(NOT notices MATCHES "\n${crate} [0-9.]+: [A-Z]")
    message(FATAL_ERROR "the licence of ${crate} is not in the archive")
  endif()
endforeach()

get_filename_component(library "${LIBRARY}" NAME)
set(where lib)
if(TRIPLE MATCHES "-windows-")
  set(where bin)
endif()
file(SIZE "${folder}/${name}/${where}/${library}" stripped)
file(SIZE "${LIBRARY}" whole)
if(NOT stripped LESS whole)
  message(FATAL_ERROR "the library in the archive has ${stripped} bytes, and before it was stripped ${whole}")
endif()

# A library that is too new for a machine is not released for it.
if(CMAKE_HOST_SYSTEM_NAME STREQUAL "Linux" AND NOT TRIPLE MATCHES "-windows-")
  execute_process(COMMAND "${SH}" "${SOURCE}/bindings/release.sh" --out "${folder}/old" ${options} --max-glibc 2.5
    RESULT_VARIABLE failed OUTPUT_QUIET ERROR_VARIABLE message)
  if(NOT failed OR NOT message MATCHES "needs glibc 2\\.[0-9]+, but --max-glibc is 2\\.5")
    message(FATAL_ERROR "a library for a newer glibc was released: ${failed} ${message}")
  endif()
endif()
