# Several sources in one unit: most of what a unit takes to compile, and to lint, is reading Eigen, Catch and fmt once more.
# Whoever changes one file often builds with -DSPHERECUT_UNITY=OFF (the preset debug does).
option(SPHERECUT_UNITY "Compile several sources together" ON)

# spherecut_unity(TARGET [SIZE n] [ALONE name...]): up to n (8) sources of a folder in one unit. Names in unnamed namespaces
# are therefore unique within a folder. On their own stay units of the large template libraries (time and memory), of one
# instruction set, and those given as ALONE.
function(spherecut_unity target)
  cmake_parse_arguments(PARSE_ARGV 1 unity "" "SIZE" "ALONE")
  if(NOT unity_SIZE)
    set(unity_SIZE 8)
  endif()
  if(NOT SPHERECUT_UNITY)
    return()
  endif()
  set_target_properties(${target} PROPERTIES UNITY_BUILD ON UNITY_BUILD_MODE GROUP)
  get_target_property(sources ${target} SOURCES)
  list(FILTER sources INCLUDE REGEX "\\.cpp$")
  foreach(source IN LISTS sources)
    cmake_path(ABSOLUTE_PATH source)
    cmake_path(GET source FILENAME name)
    file(STRINGS "${source}" heavy REGEX "^#include <(CGAL|openvdb|fcl|voro|boost/asio|boost/beast|getfem)" LIMIT_COUNT 1)
    if(heavy OR name MATCHES "^(shape|law)_kernel" OR name IN_LIST unity_ALONE)
      set_source_files_properties("${source}" PROPERTIES SKIP_UNITY_BUILD_INCLUSION ON)
    else()
      cmake_path(GET source PARENT_PATH folder)
      string(MD5 key "${folder}")
      math(EXPR count_${key} "0${count_${key}} + 1")
      math(EXPR part "(${count_${key}} - 1) / ${unity_SIZE}")
      cmake_path(GET folder FILENAME folder)
      set_source_files_properties("${source}" PROPERTIES UNITY_GROUP "${folder}_${part}")
    endif()
  endforeach()
endfunction()
