# Moves what is installed in FROM to TO: through a copy, since other tests use FROM, and through a rename.

file(REMOVE_RECURSE "${TO}" "${TO}.copy")
file(COPY "${FROM}/" DESTINATION "${TO}.copy")
file(RENAME "${TO}.copy" "${TO}")
# No file may hold the path that it was installed to.
file(GLOB_RECURSE files LIST_DIRECTORIES FALSE "${TO}/*.cmake" "${TO}/*.pc")
list(LENGTH files count)
if(count LESS 3)
  message(FATAL_ERROR "only ${count} files of the package were found in ${TO}")
endif()
foreach(file IN LISTS files)
  file(READ "${file}" text)
  string(FIND "${text}" "${FROM}" at)
  if(NOT at EQUAL -1)
    message(FATAL_ERROR "${file} holds the path ${FROM}")
  endif()
endforeach()
