# Configures and builds the project SOURCE in BUILD, which is emptied first.

file(REMOVE_RECURSE "${BUILD}")
foreach(step "-S;${SOURCE};-B;${BUILD};${OPTIONS}" "--build;${BUILD}")
  execute_process(COMMAND "${CMAKE_COMMAND}" ${step} RESULT_VARIABLE failed)
  if(failed)
    message(FATAL_ERROR "cmake ${step}: ${failed}")
  endif()
endforeach()
