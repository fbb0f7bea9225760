# Installs the build tree BUILD to PREFIX, which is emptied first; so is what has been built but for cargo's own folder, so
# that `cmake --install` has to build, as docs/hosts.md says that it does.

file(REMOVE_RECURSE "${PREFIX}" "${BUILD}/lib")
execute_process(COMMAND "${CMAKE_COMMAND}" --install "${BUILD}" --prefix "${PREFIX}" RESULT_VARIABLE failed)
if(failed)
  message(FATAL_ERROR "cmake --install: ${failed}")
endif()
