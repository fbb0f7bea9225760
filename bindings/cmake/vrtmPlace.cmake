# Puts vrtm's library into what a project ships. It is the same for a vrtm that find_package finds and for one that is a
# subfolder of the project.

# vrtm_install(DESTINATION FOLDER [TARGETS TARGET...] [COMPONENT NAME]): installs the library to FOLDER, as a file with
# the name by which loaders ask for it. TARGETS are plug-ins and programs that are installed beside it; on Linux and
# macOS they find it there, wherever the folder is moved to. On Windows a program does so, too; a plug-in's host has to
# know FOLDER.
function(vrtm_install)
  cmake_parse_arguments(PARSE_ARGV 0 place "" "DESTINATION;COMPONENT" "TARGETS")
  if(place_UNPARSED_ARGUMENTS OR NOT place_DESTINATION)
    message(FATAL_ERROR "vrtm_install(DESTINATION FOLDER [TARGETS TARGET...] [COMPONENT NAME]) got: ${ARGV}")
  endif()
  set(where DESTINATION "${place_DESTINATION}")
  if(place_COMPONENT)
    list(APPEND where COMPONENT "${place_COMPONENT}")
  endif()
  # A link would lead nowhere, so that it is the file itself that is installed.
  get_target_property(library vrtm::vrtm IMPORTED_LOCATION)
  get_filename_component(library "${library}" REALPATH)
  # libvrtm.so.0, @rpath/libvrtm.0.dylib; a DLL has none, and is loaded by its file's name.
  get_target_property(name vrtm::vrtm IMPORTED_SONAME)
  if(NOT name)
    set(name "${library}")
  endif()
  get_filename_component(name "${name}" NAME)
  install(PROGRAMS "${library}" ${where} RENAME "${name}")
  if(TARGET vrtm_build AND NOT TARGET vrtm_to_install)
    # A plug-in that loads the library by itself is not linked with it, and does not have it built.
    add_custom_target(vrtm_to_install ALL)
    add_dependencies(vrtm_to_install vrtm_build)
  endif()
  if(place_TARGETS)
    if(APPLE)
      set_property(TARGET ${place_TARGETS} APPEND PROPERTY INSTALL_RPATH "@loader_path")
    else()
      set_property(TARGET ${place_TARGETS} APPEND PROPERTY INSTALL_RPATH "$ORIGIN")
    endif()
    install(TARGETS ${place_TARGETS} ${where})
  endif()
endfunction()
