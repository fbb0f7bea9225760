# Installs the build tree BUILD of tests/package/consumer, moves what it installs to TO, and there runs the program and loads
# the PLUGINS with LOADS, the program of loads.c, without any help to find the library. RUN is an emulator, if there is one.

file(REMOVE_RECURSE "${TO}" "${TO}.installed")
execute_process(COMMAND "${CMAKE_COMMAND}" --install "${BUILD}" --prefix "${TO}.installed" RESULT_VARIABLE failed)
if(failed)
  message(FATAL_ERROR "cmake --install: ${failed}")
endif()
file(RENAME "${TO}.installed" "${TO}")
unset(ENV{LD_LIBRARY_PATH})
unset(ENV{DYLD_LIBRARY_PATH})
# A plug-in's functions, and one of the library that it brings along.
file(WRITE "${TO}/names" "vrtm_version vrtm_asset_submit\n")
execute_process(COMMAND ${RUN} "${TO}/program/consumer_c${SUFFIX}" RESULT_VARIABLE failed)
if(failed)
  message(SEND_ERROR "${TO}/program/consumer_c does not run: ${failed}")
endif()
foreach(plugin IN LISTS PLUGINS)
  execute_process(COMMAND ${RUN} "${LOADS}" "${TO}/${plugin}" INPUT_FILE "${TO}/names" RESULT_VARIABLE failed)
  if(failed)
    message(SEND_ERROR "${plugin} does not load: ${failed}")
  endif()
endforeach()
