# The rules of `cmake --install`. `bindings/install.sh` installs the same files; tests/package compares both trees.

include(GNUInstallDirs)

# vrtm_relative(VARIABLE FROM TO): TO, seen from the folder FROM; both are folders in the prefix.
function(vrtm_relative variable from to)
  file(RELATIVE_PATH path "/prefix/${from}" "/prefix/${to}")
  if(path STREQUAL "")
    set(path .)
  endif()
  string(REGEX REPLACE "/$" "" path "${path}")
  set(${variable} "${path}" PARENT_SCOPE)
endfunction()

# vrtm_add_install(FOLDER): installs the library that the target `vrtm_build` puts into FOLDER, and all that goes with it.
function(vrtm_add_install folder)
  foreach(part LIBDIR BINDIR INCLUDEDIR DATAROOTDIR)
    if(IS_ABSOLUTE "${CMAKE_INSTALL_${part}}")
      message(FATAL_ERROR "vrtm: CMAKE_INSTALL_${part} is ${CMAKE_INSTALL_${part}}, but must be relative to the prefix, "
        "so that the installed tree can be moved")
    endif()
  endforeach()
  set(VRTM_LIB "${CMAKE_INSTALL_LIBDIR}")
  set(VRTM_INCLUDE "${CMAKE_INSTALL_INCLUDEDIR}")
  set(VRTM_IMPORT_LIBRARY)
  if(VRTM_FILE_IMPORT)
    set(VRTM_LIBRARY "${CMAKE_INSTALL_BINDIR}/${VRTM_FILE}")
    set(VRTM_IMPORT_LIBRARY "${VRTM_LIB}/${VRTM_FILE_IMPORT}")
  else()
    set(VRTM_LIBRARY "${VRTM_LIB}/${VRTM_FILE}")
  endif()
  vrtm_relative(VRTM_FROM_CMAKE "${VRTM_LIB}/cmake/vrtm" "")
  vrtm_relative(VRTM_FROM_PKGCONFIG "${VRTM_LIB}/pkgconfig" "")
  set(VRTM_VERSION ${vrtm_VERSION})
  set(VRTM_MAJOR ${vrtm_VERSION_MAJOR})
  set(VRTM_POINTER_BYTES ${CMAKE_SIZEOF_VOID_P})

  set(package "${vrtm_BINARY_DIR}/package")
  foreach(file vrtmConfig.cmake vrtmConfigVersion.cmake vrtm.pc)
    configure_file("${vrtm_SOURCE_DIR}/bindings/cmake/${file}.in" "${package}/${file}" @ONLY)
  endforeach()

  # `cmake -S . -B build && cmake --install build` is enough: what has not been built is built by the install.
  install(CODE "
    if(NOT EXISTS \"${folder}/${VRTM_FILE}\")
      execute_process(COMMAND \"${CMAKE_COMMAND}\" --build \"${CMAKE_BINARY_DIR}\" --target vrtm_build --config \"$<CONFIG>\"
        RESULT_VARIABLE failed)
      if(failed)
        message(FATAL_ERROR \"vrtm: the library is not built: cmake --build gave \${failed}\")
      endif()
    endif()")
  if(VRTM_FILE_IMPORT)
    install(PROGRAMS "${folder}/${VRTM_FILE}" DESTINATION "${CMAKE_INSTALL_BINDIR}")
    install(FILES "${folder}/${VRTM_FILE_IMPORT}" DESTINATION "${VRTM_LIB}")
  else()
    install(PROGRAMS "${folder}/${VRTM_FILE}" DESTINATION "${VRTM_LIB}")
    foreach(link IN LISTS VRTM_LINKS)
      install(FILES "${folder}/${link}" DESTINATION "${VRTM_LIB}")
    endforeach()
  endif()
  install(FILES "${vrtm_SOURCE_DIR}/include/vrtm.h" "${vrtm_SOURCE_DIR}/include/vrtm.hpp" DESTINATION "${VRTM_INCLUDE}")
  install(FILES "${package}/vrtmConfig.cmake" "${package}/vrtmConfigVersion.cmake"
    "${vrtm_SOURCE_DIR}/bindings/cmake/vrtmPlace.cmake" DESTINATION "${VRTM_LIB}/cmake/vrtm")
  install(FILES "${package}/vrtm.pc" DESTINATION "${VRTM_LIB}/pkgconfig")
  foreach(file LICENSE LICENSE-MIT LICENSE-APACHE bindings/THIRD-PARTY.txt)
    install(FILES "${vrtm_SOURCE_DIR}/${file}" DESTINATION "${CMAKE_INSTALL_DATAROOTDIR}/doc/vrtm")
  endforeach()
endfunction()
