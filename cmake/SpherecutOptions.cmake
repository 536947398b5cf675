# Language, warnings, optimisation and sanitizers, for every target of the project.
set(CMAKE_CXX_STANDARD 20)
set(CMAKE_CXX_STANDARD_REQUIRED ON)
set(CMAKE_CXX_EXTENSIONS OFF)
set(CMAKE_POSITION_INDEPENDENT_CODE ON)
set(CMAKE_EXPORT_COMPILE_COMMANDS ON)

if(NOT CMAKE_BUILD_TYPE)
  set(CMAKE_BUILD_TYPE Release CACHE STRING "Build type" FORCE)
endif()
# The release build keeps assert() and CGAL's checks: they cost little and the tests run against what ships.
# Eigen's index checks sit inside the hot loops; they stay on in Debug and under the sanitizers.
set(CMAKE_CXX_FLAGS_RELEASE "-O3 -DEIGEN_NO_DEBUG")

find_program(SPHERECUT_CCACHE ccache)
if(SPHERECUT_CCACHE)
  set(CMAKE_CXX_COMPILER_LAUNCHER "${SPHERECUT_CCACHE}")
endif()

add_library(spherecut_options INTERFACE)
target_compile_features(spherecut_options INTERFACE cxx_std_20)
# Debian's libfcl and libopenvdb are built for baseline x86-64: Eigen types must keep the alignment they have there. This
# does it for members; memory that Eigen takes follows the compiler's flags, which topology/base/types.hpp looks at.
target_compile_definitions(spherecut_options INTERFACE EIGEN_MAX_ALIGN_BYTES=16)

add_library(spherecut_warnings INTERFACE)
target_compile_options(spherecut_warnings INTERFACE -Wall -Wextra -Wpedantic -Wnon-virtual-dtor -Woverloaded-virtual)
if(SPHERECUT_UNITY) # a name of one file is no concern of the next one in its unit
  target_compile_options(spherecut_warnings INTERFACE $<$<CXX_COMPILER_ID:GNU>:-Wshadow=local> $<$<CXX_COMPILER_ID:GNU>:-Wno-subobject-linkage>)
else()
  target_compile_options(spherecut_warnings INTERFACE -Wshadow)
endif()
if(SPHERECUT_WERROR)
  target_compile_options(spherecut_warnings INTERFACE -Werror)
endif()

# -O1 and line numbers alone: a CGAL unit with full debug information takes twice as long and 1.7 GB.
set(CMAKE_CXX_FLAGS_SANITIZE "-O1 -g1 -fno-omit-frame-pointer")
# As optimised as lines can still be told apart: most tests solve, and would take an hour without.
set(CMAKE_CXX_FLAGS_COVERAGE "-O1 -g1")
set(SPHERECUT_ASAN_FLAGS -fsanitize=address,undefined -fno-sanitize-recover=undefined)
set(SPHERECUT_TSAN_FLAGS -fsanitize=thread)
foreach(sanitizer ASAN TSAN)
  if((sanitizer STREQUAL "ASAN" AND SPHERECUT_SANITIZE_ADDRESS) OR (sanitizer STREQUAL "TSAN" AND SPHERECUT_SANITIZE_THREAD))
    add_compile_options(${SPHERECUT_${sanitizer}_FLAGS})
    add_link_options(${SPHERECUT_${sanitizer}_FLAGS})
  endif()
endforeach()
